"""Tune the event-density baseline on training recordings: where DENSITY_THRESHOLD of evimo.evaluation comes from.

    python bench/density.py FOLDER [--every 1]

FOLDER holds recordings that are never evaluated on. Prints IoU and event IoU of every threshold.
"""

import argparse
from pathlib import Path

from rich.console import Console
from rich.table import Table

from evimo.cli.evaluate import recordings_in
from evimo.evaluation.baselines import THRESHOLDS, best_threshold, threshold_scores
from evimo.evaluation.scoring import labelled_slices
from evimo.recordings.recording import open_recording

COLUMNS = ("iou", "iou_pooled", "event_iou", "recall", "clutter", "false_alarm_events")


def main() -> None:
    """Parse, score every threshold, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--every", type=int, default=1, help="take one recording in so many")
    options = parser.parse_args()
    recordings = [open_recording(path) for path in recordings_in([options.folder])[:: options.every]]
    samples = (sample for recording in recordings for sample in labelled_slices(recording))
    scores = threshold_scores(samples)
    title = f"event density on {len(recordings)} recordings; best {best_threshold(scores):g} x mean"
    table = Table("threshold", *COLUMNS, title=title, title_justify="left")
    for threshold in THRESHOLDS:
        values = (scores[threshold][name].value if name in scores[threshold] else None for name in COLUMNS)
        table.add_row(f"{threshold:g}", *("–" if value is None else f"{value:.3f}" for value in values))
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
