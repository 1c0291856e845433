"""Share of events and pixels called moving in clips where nothing moves by itself; should be under 10 %.

    python bench/poster.py CLIP... [--model small]

CLIP: any recording without movers, such as DAVIS240C poster_translation, whose only motion is the camera's.
"""

import argparse
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from evimo import streaming
from evimo.evaluation.ratios import Score
from evimo.events.slices import in_slices
from evimo.formats import open_events
from evimo.geometry.calibration import load_camera

LIMIT = 0.10


def false_alarms(path: Path, *, model: str, calibration: Path | None = None) -> tuple[Score, Score]:
    """Events called moving, and valid pixels called moving, over all complete slices."""
    recording = open_events(path)
    camera = None if calibration is None else load_camera(calibration, size=recording.sensor)
    slices = in_slices(recording, stop_us=recording.stop_us)
    events, pixels = Score(0, 0, 0), Score(0, 0, 0)
    for estimate in streaming.run(recording, model=model, camera=camera):
        part = next(each for each in slices if each.start_us == estimate.start_us)
        seen = estimate.valid[part.events.y, part.events.x]
        called = estimate.moving[part.events.y, part.events.x]
        events += Score(int(np.count_nonzero(called)), int(np.count_nonzero(seen)))
        pixels += Score(int(np.count_nonzero(estimate.moving)), int(np.count_nonzero(estimate.valid)))
    return events, pixels


def main() -> None:
    """Parse, score, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clips", type=Path, nargs="+")
    parser.add_argument("--model", default="small")
    parser.add_argument("--calibration", type=Path)
    options = parser.parse_args()
    heads = ("clip", "slices", "events called moving ↓", "pixels called moving ↓", "under 10 %")
    table = Table(*heads, title=f"nothing moves here: false alarms of {options.model}", title_justify="left")
    for clip in options.clips:
        if not clip.exists():
            table.add_row(clip.name, "–", "skipped: not here", "–", "–")
            continue
        events, pixels = false_alarms(clip, model=options.model, calibration=options.calibration)
        share = events.value or 0.0
        verdict = "yes" if share < LIMIT else "NO"
        table.add_row(clip.name, str(events.samples), f"{share:.1%}", f"{pixels.value or 0.0:.1%}", verdict)
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
