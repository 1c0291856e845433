"""What is called moving where the camera stands still: there, events come from what moves and from noise alone.

    python bench/road.py CLIP... [--model small]

CLIP: a recording whose camera stands still, such as davis346_road. Where events crowd, something moves, and all within
8 px of a crowd may belong to it; everywhere else nothing moves. A crowd is 6 events on 4 pixels or more within 7x7 px
and one slice; noise of 0.1 Hz per pixel makes 0.12 events there.
"""

import argparse
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from evimo import streaming
from evimo.evaluation.ratios import Score
from evimo.events.slices import in_slices
from evimo.formats import open_events
from evimo.geometry.calibration import load_camera

WINDOW, EVENTS, PIXELS = (7, 7), 6, 4
NEAR_PX = 8

Counts = NDArray[np.float32]
Mask = NDArray[np.bool_]


def crowded(counts: Counts) -> Mask:
    """Pixels with a crowd of events around them, (H, W)."""
    events = cv2.boxFilter(counts, -1, WINDOW, normalize=False)
    active = cv2.boxFilter((counts > 0).astype(np.float32), -1, WINDOW, normalize=False)
    return (events >= EVENTS - 0.5) & (active >= PIXELS - 0.5)


def near(mask: Mask, reach_px: int) -> Mask:
    """What is within reach of a mask, holes and bays narrower than twice that filled."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach_px + 1, 2 * reach_px + 1))
    wide = cv2.dilate(mask.astype(np.uint8), disc, iterations=2)
    return cv2.erode(wide, disc) > 0


def scores(path: Path, *, model: str, calibration: Path | None = None) -> dict[str, Score]:
    """Shares called moving over all slices: of crowded events, of other events, of pixels far from any crowd."""
    recording = open_events(path)
    camera = None if calibration is None else load_camera(calibration, size=recording.sensor)
    slices = in_slices(recording, stop_us=recording.stop_us)
    total = {name: Score(0, 0, 0) for name in ("crowded events", "lonely events", "far pixels")}
    for estimate in streaming.run(recording, model=model, camera=camera):
        part = next(each for each in slices if each.start_us == estimate.start_us)
        counts = np.zeros(recording.sensor, np.float32)
        np.add.at(counts, (part.events.y, part.events.x), 1)
        crowd = crowded(counts) & (counts > 0)
        masks = {
            "crowded events": counts * crowd,
            "lonely events": counts * ~near(crowd, NEAR_PX),
            "far pixels": (~near(crowd, NEAR_PX)).astype(np.float32),
        }
        for name, weight in masks.items():
            seen = weight * estimate.valid
            total[name] += Score(float((seen * estimate.moving).sum()), float(seen.sum()))
    return total


def main() -> None:
    """Parse, score, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clips", type=Path, nargs="+")
    parser.add_argument("--model", default="small")
    parser.add_argument("--calibration", type=Path)
    options = parser.parse_args()
    heads = ("clip", "slices", "crowded events called moving ↑", "others ↓", "pixels far from crowds ↓")
    table = Table(*heads, title=f"the camera stands still: {options.model}", title_justify="left")
    for clip in options.clips:
        found = scores(clip, model=options.model, calibration=options.calibration)
        shares = (f"{score.value or 0.0:.2%}" for score in found.values())
        table.add_row(clip.name, str(found["far pixels"].samples), *shares)
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
