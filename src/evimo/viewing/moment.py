"""What a frame tells of one slice beside its maps: camera motion and objects, from estimates or from truth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.events.slices import Slice
from evimo.recordings.estimate import Estimate
from evimo.recordings.truth import Truth


@dataclass(frozen=True, slots=True)
class Mark:
    """An object in view, as it is drawn.

    box:      x0, y0, x1, y1 in sensor px, the last column and row included.
    centroid: (x, y) in sensor px.
    velocity: (3,) relative to the static world, camera axes, in lengths per second.
    """

    id: int
    box: tuple[int, int, int, int]
    centroid: tuple[float, float]
    velocity: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Moment:
    """One slice. Lengths are mean depths in estimates and m in truth; the drawing names the unit.

    ego:      (6,) the camera's twist relative to the static world, camera axes.
    headline: the objects in words.
    """

    t_us: int
    start_us: int
    stop_us: int
    ego: NDArray[np.float64]
    marks: tuple[Mark, ...]
    headline: str


def estimated(estimate: Estimate) -> Moment:
    """The moment of an estimate; unknown velocities are drawn as zero."""
    marks = tuple(
        Mark(one.id, one.box, one.centroid, np.nan_to_num(np.asarray(one.rel_velocity, np.float64)))
        for one in estimate.objects or ()
    )
    headline = f"{len(marks)} moving object{'' if len(marks) == 1 else 's'}"
    if estimate.objects is None:
        headline = "moving objects not estimated"
    if not estimate.has_events:
        headline = "no events"
    ego = np.nan_to_num(estimate.ego)
    return Moment(estimate.t_us, estimate.start_us, estimate.stop_us, ego, marks, headline)


def true(truth: Truth, part: Slice) -> Moment:
    """The moment of a slice whose truth is known; its marks are the objects that some pixel sees."""
    marks = tuple(
        _seen(id_, truth.ids == id_, moved.velocity) for id_, moved in truth.objects.items() if (truth.ids == id_).any()
    )
    resting = sum(not truth.objects[mark.id].moves for mark in marks)
    headline = f"{len(marks)} object{'' if len(marks) == 1 else 's'} in view"
    headline += f", {resting} at rest" if resting else ""
    return Moment(truth.t_us, part.start_us, part.stop_us, truth.ego, marks, headline)


def _seen(object_id: int, mask: NDArray[np.bool_], velocity: NDArray[np.float64]) -> Mark:
    rows, columns = np.nonzero(mask)
    box = int(columns.min()), int(rows.min()), int(columns.max()), int(rows.max())
    return Mark(object_id, box, (float(columns.mean()), float(rows.mean())), velocity)
