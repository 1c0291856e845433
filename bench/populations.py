"""What recordings ask for: how large their movers are, how they move against the static world, what nobody can decide.

    python bench/populations.py FOLDER... [--tuned-on OTHER] [--every 1]

Each FOLDER holds recordings of one population. Prints quantiles over movers and slices, and the scores of masks that
need no learning: all moves, event density (with the threshold of evimo evaluate, with the best one on FOLDER, an
oracle, and with the best one on OTHER), and the ceilings of geometry at several thresholds.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from evimo.evaluation.baselines import (
    DENSITY_THRESHOLD,
    EVERYTHING,
    THRESHOLDS,
    best_threshold,
    density_scores,
    tune_density_threshold,
)
from evimo.evaluation.ceilings import THRESHOLDS_PX, ceiling_scores
from evimo.evaluation.columns import BY_NAME
from evimo.evaluation.labels import LabelledSlice, Mover
from evimo.evaluation.ratios import Scores, added
from evimo.evaluation.scores import mask_scores
from evimo.evaluation.scoring import labelled_slices
from evimo.evaluation.tables import cell, header
from evimo.recordings.finding import recordings_in
from evimo.recordings.recording import open_recording

QUANTILES = (10, 25, 50, 75, 90)
COLUMNS = ("iou", "iou_pooled", "event_iou", "recall", "detected", "clutter", "false_alarm_events")
Row = str | float  # a threshold of event density, or the name of another answer


def slices(folder: Path, every: int) -> Iterator[LabelledSlice]:
    """Those of one recording in so many."""
    for path in recordings_in([folder])[::every]:
        yield from labelled_slices(open_recording(path))


def facts(mover: Mover, sample: LabelledSlice) -> tuple[float, float, int]:
    """Area in %, residual motion in px per slice, events: those that come from it, or else those in its pixels."""
    ids = sample.truth.ids[sample.events.y, sample.events.x] if sample.event_ids is None else sample.event_ids
    residual = np.nan if mover.residual_px is None else mover.residual_px
    return 100 * mover.area, residual, int(np.count_nonzero(ids == mover.id))


def answers(sample: LabelledSlice) -> dict[Row, Scores]:
    """Scores of every mask that needs no learning."""
    rows: dict[Row, Scores] = {EVERYTHING: mask_scores(np.ones(sample.scored.shape, np.bool_), sample)}
    rows |= density_scores(sample, (*THRESHOLDS, DENSITY_THRESHOLD))
    for threshold in THRESHOLDS_PX:
        ceilings = ceiling_scores(sample, threshold_px=threshold)
        rows |= {f"{row}, {threshold:g} px": scores for row, scores in ceilings.items()}
    return rows


def movers_table(title: str, movers: list[tuple[float, float, int]]) -> Table:
    """Quantiles over movers and slices."""
    table = Table("", *(f"{quantile} %" for quantile in QUANTILES), title=title, title_justify="left")
    for k, (name, digits) in enumerate((("area, %", 2), ("residual motion, px per slice", 2), ("events", 0))):
        values = np.array([each[k] for each in movers], float)
        found = np.percentile(values[np.isfinite(values)], QUANTILES)
        table.add_row(name, *(f"{value:.{digits}f}" for value in found))
    return table


def answers_table(title: str, rows: dict[Row, Scores], tuned: float | None) -> Table:
    """One line per answer; of the thresholds of event density only those that somebody would choose."""
    oracle = best_threshold({threshold: rows[threshold] for threshold in THRESHOLDS})
    chosen: dict[str, Row] = {
        EVERYTHING: EVERYTHING,
        f"event density, {DENSITY_THRESHOLD:g} x mean": DENSITY_THRESHOLD,
        f"event density, oracle {oracle:g} x mean": oracle,
    }
    chosen |= {} if tuned is None else {f"event density, tuned elsewhere {tuned:g} x mean": tuned}
    chosen |= {row: row for row in sorted(row for row in rows if isinstance(row, str) and row != EVERYTHING)}
    columns = [BY_NAME[name] for name in COLUMNS]
    table = Table("", *(header(column) for column in columns), title=title, title_justify="left")
    for name, row in chosen.items():
        table.add_row(name, *(cell(rows[row].get(column.name), column) for column in columns))
    return table


def main() -> None:
    """Parse, go through every population once, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", type=Path, nargs="+", metavar="FOLDER")
    parser.add_argument("--tuned-on", type=Path, help="recordings that are in no FOLDER")
    parser.add_argument("--every", type=int, default=1, help="take one recording in so many")
    options = parser.parse_args()
    tuned = tune_density_threshold(slices(options.tuned_on, options.every)) if options.tuned_on else None
    console = Console(width=130)
    for folder in options.folders:
        movers: list[tuple[float, float, int]] = []
        rows: dict[Row, Scores] = {}
        count = 0
        for sample in slices(folder, options.every):
            movers += [facts(mover, sample) for mover in sample.movers]
            rows = {row: added((rows.get(row, {}), scores)) for row, scores in answers(sample).items()}
            count += 1
        if movers:
            console.print(movers_table(f"{folder}: {len(movers)} movers in {count} slices", movers))
        console.print(answers_table(f"{folder}: without learning", rows, tuned))


if __name__ == "__main__":
    main()
