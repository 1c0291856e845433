"""Event IoU against a moving circle: the pseudo truth of a real clip in which one ball flies."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, NotFound
from evimo.evaluation import baselines
from evimo.evaluation.metrics import Mask, overlap
from evimo.evaluation.ratios import Score, Scores, added
from evimo.events.events import Events
from evimo.events.slices import Slice

MARGIN_PX = 3.0
"""Added to the radius: a ball fires a little outside its outline too."""


@dataclass(frozen=True, slots=True)
class Circles:
    """A circle at some times: t_s seconds after the recording's first event, the rest px; all (N,) float64."""

    t_s: NDArray[np.float64]
    cx: NDArray[np.float64]
    cy: NDArray[np.float64]
    r: NDArray[np.float64]

    def distance(self, x: NDArray[np.float64], y: NDArray[np.float64], t_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Px from the circle's line at those times, negative inside; linear between the known times."""
        cx, cy, r = (np.interp(t_s, self.t_s, each) for each in (self.cx, self.cy, self.r))
        return np.hypot(x - cx, y - cy) - r


def load_circles(path: str | Path) -> Circles:
    """Columns t_s, cx, cy, r of a CSV file; lines that start with # are remarks.

    Raises:
        NotFound: no such file.
        BadFile: a column is missing or not a number.
    """
    if not Path(path).is_file():
        raise NotFound(f"no file {str(path)!r}", fix="a CSV file with the columns t_s, cx, cy, r")
    with Path(path).open(encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    try:
        columns = [np.array([float(row[name]) for row in rows]) for name in ("t_s", "cx", "cy", "r")]
    except (KeyError, ValueError, TypeError) as error:
        raise BadFile(f"{path}: bad column or number {error}", fix="the columns t_s, cx, cy, r, in s and px") from error
    return Circles(*columns)


def circle_scores(
    part: Slice, moving: Mask, circles: Circles, *, first_us: int, labels: Mask | None = None
) -> dict[str, Scores]:
    """Event IoU of one slice, by row; truth is each event's distance at its own time.

    An event moves if it lies within the radius + 3 px; events outside the truth's time range are left out. Rows: the
    mask, `labels` (N,) of the slice's events if given, the trivial answers, every density threshold ("density 1.23"),
    and the same circle drawn once at the slice's centre, which is the most a mask per slice can be expected to reach.
    """
    t_s = np.asarray((part.events.t - first_us) * 1e-6, np.float64)
    known = (t_s >= circles.t_s[0]) & (t_s <= circles.t_s[-1])
    events = Events(part.events.x[known], part.events.y[known], part.events.t[known], part.events.p[known])
    x, y, t_s = events.x.astype(np.float64), events.y.astype(np.float64), t_s[known]
    truth = circles.distance(x, y, t_s) <= MARGIN_PX
    centre_s = np.full(len(events), ((part.start_us + part.stop_us) / 2 - first_us) * 1e-6)
    density = baselines.event_density(part.events, moving.shape)[events.y, events.x]
    called = {
        "model": moving[events.y, events.x],
        **({} if labels is None else {"model, every event labelled": labels[known]}),
        "nothing moves": np.zeros(len(events), np.bool_),
        "everything moves": np.ones(len(events), np.bool_),
        "circle drawn at the slice's centre": circles.distance(x, y, centre_s) <= MARGIN_PX,
        f"density {baselines.DENSITY_THRESHOLD:g}, tuned elsewhere": density > baselines.DENSITY_THRESHOLD,
    } | {f"density {each:g}": density > each for each in baselines.THRESHOLDS}
    return {row: event_scores(mask, truth) for row, mask in called.items()}


def event_scores(called: Mask, truth: Mask) -> Scores:
    """Event IoU, recall and the share of other events called moving."""
    cut, union = overlap(called, truth)
    moving, still = int(np.count_nonzero(truth)), int(np.count_nonzero(~truth))
    return {
        "event_iou": Score(cut, union),
        "recall": Score(cut, moving),
        "false_alarm_events": Score(int(np.count_nonzero(called & ~truth)), still),
    }


def added_rows(parts: list[dict[str, Scores]]) -> dict[str, Scores]:
    """Rows of several slices as one table."""
    names = dict.fromkeys(name for part in parts for name in part)
    return {name: added(part.get(name, {}) for part in parts) for name in names}
