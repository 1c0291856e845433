"""How well the rotation of a camera on a pan-tilt unit is seen, and the share of events called moving; nothing moves.

    python bench/pan_tilt.py FOLDER [--model small]

FOLDER: `events.npz` (arrays t, x, y, p; µs) and `truth.json` (`omega_cam_rad_s`, `K`, `D`), such as davis240_pan_tilt.
"""

import argparse
import json
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

import evimo
from evimo.evaluation.ratios import Score

SIZE = (180, 240)


def main() -> None:
    """Parse, run, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--model", default="small")
    options = parser.parse_args()
    truth = json.loads((options.folder / "truth.json").read_text())
    lens = tuple(float(value) for value in truth["D"][:4])
    camera = evimo.Camera(*(float(value) for value in truth["K"]), *SIZE, distortion=lens)
    with np.load(options.folder / "events.npz") as stored:
        rows = np.stack([stored[name] for name in "txyp"], axis=1)
    rates, called = [], Score(0, 0, 0)
    for estimate in evimo.run(rows, model=options.model, camera=camera, event_labels=True):
        rates.append(estimate.ego[3:])
        events = estimate.event_labels.events
        inside = estimate.valid[events.y, events.x]
        moving = estimate.moving[events.y, events.x]
        called += Score(int(np.count_nonzero(moving)), int(np.count_nonzero(inside)))
    rate, true_rate = np.median(rates, axis=0), np.array(truth["omega_cam_rad_s"])
    error, speed = np.linalg.norm(rate - true_rate), np.linalg.norm(true_rate)
    table = Table("", "", title=f"{options.model} on {options.folder.name}: nothing moves", title_justify="left")
    table.add_row("slices", str(len(rates)))
    table.add_row("median rotation, rad/s", np.array2string(rate, precision=3))
    table.add_row("true rotation, rad/s", np.array2string(true_rate, precision=3))
    table.add_row("error of the median, of the true speed", f"{error / speed:.1%}")
    table.add_row("events called moving", f"{called.value or 0.0:.1%}")
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
