"""Event IoU on the thrown ball of EED "what is background": masks, labels of events, and the trivial answers.

    python bench/eed.py FOLDER [--model small] [--calibration FILE] [--save out/eed.json]

FOLDER holds the .es file and ball_circle_gt.csv. An event moves if it lies within the circle's radius + 3 px at the
event's own time. A threshold "tuned on this clip" is an oracle: the baseline that a model has to beat there.
"""

import argparse
import json
from pathlib import Path

from rich.console import Console
from rich.table import Table

from evimo import streaming
from evimo.evaluation.baselines import THRESHOLDS
from evimo.evaluation.circles import Circles, added_rows, circle_scores, load_circles
from evimo.evaluation.ratios import Scores
from evimo.events.slices import in_slices
from evimo.formats import open_events
from evimo.geometry.calibration import load_camera

CIRCLES = "ball_circle_gt.csv"


def ball_rows(folder: Path, *, model: str, calibration: Path | None = None) -> dict[str, Scores]:
    """Scores of the model and of every trivial answer over all complete slices of the clip."""
    recording = open_events(next(folder.glob("*.es")))
    circles: Circles = load_circles(folder / CIRCLES)
    camera = None if calibration is None else load_camera(calibration, size=recording.sensor)
    slices = {each.start_us: each for each in in_slices(recording, stop_us=recording.stop_us)}
    parts: list[dict[str, Scores]] = []
    for each in streaming.run(recording, model=model, camera=camera, event_labels=True):
        if each.start_us in slices and each.event_labels is not None:
            part, labels = slices[each.start_us], each.event_labels.objects > 0
            parts.append(circle_scores(part, each.moving, circles, first_us=recording.start_us, labels=labels))
    rows = added_rows(parts)
    best = max((f"density {each:g}" for each in THRESHOLDS), key=lambda row: rows[row]["event_iou"].value or 0.0)
    kept = {row: scores for row, scores in rows.items() if not row.startswith("density") or "tuned" in row}
    return kept | {f"{best}, tuned on this clip": rows[best]}


def as_table(rows: dict[str, Scores], title: str) -> Table:
    """The rows for the terminal."""
    table = Table("", "event IoU ↑", "recall ↑", "false alarms ↓", title=title, title_justify="left")
    for row, scores in rows.items():
        numbers = (scores[name].value for name in ("event_iou", "recall", "false_alarm_events"))
        table.add_row(row, *("–" if number is None else f"{number:.3f}" for number in numbers))
    return table


def main() -> None:
    """Parse, score, print, save."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--model", default="small")
    parser.add_argument("--calibration", type=Path)
    parser.add_argument("--save", type=Path, help="write the rows as JSON")
    options = parser.parse_args()
    if not (options.folder / CIRCLES).is_file():
        Console().print(f"skipped: no {CIRCLES} in {options.folder}; the clip is not part of this repository")
        return
    rows = ball_rows(options.folder, model=options.model, calibration=options.calibration)
    events = rows["everything moves"]["recall"].bottom, rows["everything moves"]["false_alarm_events"].bottom
    title = f"EED thrown ball, {options.model}: {events[0]:,.0f} moving and {events[1]:,.0f} other events"
    Console(width=110).print(as_table(rows, title))
    if options.save:
        values = {row: {name: each.value for name, each in scores.items()} for row, scores in rows.items()}
        options.save.parent.mkdir(parents=True, exist_ok=True)
        options.save.write_text(json.dumps({"model": options.model, "rows": values}, indent=1) + "\n")


if __name__ == "__main__":
    main()
