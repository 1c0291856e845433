"""How much of moving objects their event density gives away; tunes the baseline, DENSITY_THRESHOLD of evimo.evaluation.

    python bench/density.py FOLDER [--tuned-on OTHER] [--every 1]

FOLDER and OTHER hold recordings. Prints IoU and event IoU of every threshold on FOLDER, the best one on it (an oracle),
the one that is best on OTHER (`evimo simulate --replica`: FOLDER is test, OTHER is train), and the floor: all moves.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from evimo.cli.evaluate import recordings_in
from evimo.evaluation.baselines import THRESHOLDS, best_threshold, density_scores
from evimo.evaluation.labels import LabelledSlice
from evimo.evaluation.ratios import Scores, added
from evimo.evaluation.scores import mask_scores
from evimo.evaluation.scoring import labelled_slices
from evimo.recordings.recording import open_recording

COLUMNS = ("iou", "iou_pooled", "event_iou", "recall", "clutter", "false_alarm_events")
FLOOR = 0.0  # of all thresholds: everything moves


def slices(folder: Path, every: int) -> Iterator[LabelledSlice]:
    """Of one recording in so many."""
    for path in recordings_in([folder])[::every]:
        yield from labelled_slices(open_recording(path))


def scored(folder: Path, every: int) -> dict[float, Scores]:
    """Of every threshold, and of the floor."""
    totals: dict[float, Scores] = {threshold: {} for threshold in (FLOOR, *THRESHOLDS)}
    for sample in slices(folder, every):
        now = density_scores(sample, THRESHOLDS) | {FLOOR: mask_scores(np.ones(sample.scored.shape, np.bool_), sample)}
        totals = {key: added((totals[key], now[key])) for key in totals}
    return totals


def row(scores: Scores) -> list[str]:
    """One line of the table."""
    values = (scores[name].value if name in scores else None for name in COLUMNS)
    return ["–" if value is None else f"{value:.3f}" for value in values]


def main() -> None:
    """Parse, score every threshold, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--tuned-on", type=Path, help="recordings that are not in FOLDER")
    parser.add_argument("--every", type=int, default=1, help="take one recording in so many")
    options = parser.parse_args()
    scores = scored(options.folder, options.every)
    best = best_threshold({key: scores[key] for key in THRESHOLDS})
    chosen = {"everything moves": FLOOR, f"oracle, {best:g} x mean": best}
    if options.tuned_on:
        other = scored(options.tuned_on, options.every)
        tuned = best_threshold({key: other[key] for key in THRESHOLDS})
        chosen[f"tuned on {options.tuned_on.name}, {tuned:g} x mean"] = tuned
    table = Table("threshold", *COLUMNS, title="event density", title_justify="left")
    for threshold in THRESHOLDS:
        table.add_row(f"{threshold:g}", *row(scores[threshold]))
    table.add_section()
    for name, threshold in chosen.items():
        table.add_row(name, *row(scores[threshold]))
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
