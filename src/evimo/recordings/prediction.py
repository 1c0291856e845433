"""What any program says of one slice, be it all of an `Estimate` or a mask alone."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.recordings.estimate import Estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """A prediction says of one slice what there is to score, in sensor pixels (H, W); None is what it leaves out.

    moving:        bool, the motion mask.
    ids:           int32, a number for each object, 0 where nothing moves; None where objects have no names.
    probability:   float32, 0...1, that the pixel moves.
    event_objects: (N,) int64, of each event of the slice the object it belongs to, 0 is static.
    rel_depth:     depth along the optical axis, in any unit.
    ego:           (6,) the camera's twist, camera axes: in the depth's unit per second, and in rad/s.
    velocity:      (H, W, 3) of the object that each pixel shows, in the depth's unit per second; 0 on the background.
    flow:          (2, H, W) image velocity on the plane Z = 1, in 1/s.
    valid:         bool, False where it says nothing; None where it speaks of every pixel.
    has_events:    False where the program says that the slice has none, so that it knows nothing.
    """

    moving: NDArray[np.bool_] | None = None
    ids: NDArray[np.int32] | None = None
    probability: NDArray[np.float32] | None = None
    event_objects: NDArray[np.int64] | None = None
    rel_depth: NDArray[np.floating] | None = None
    ego: NDArray[np.float64] | None = None
    velocity: NDArray[np.float64] | None = None
    flow: NDArray[np.float32] | None = None
    valid: NDArray[np.bool_] | None = None
    has_events: bool = True


def prediction_of(estimate: Estimate) -> Prediction:
    """Return what an estimate says as a prediction."""
    labels = estimate.event_labels
    ids = None if estimate.ids is None else estimate.ids.astype(np.int32)
    velocities = {body.id: body.rel_velocity for body in estimate.objects or ()}
    return Prediction(
        moving=estimate.moving,
        ids=ids,
        probability=estimate.moving_probability,
        event_objects=None if labels is None else labels.objects.astype(np.int64),
        rel_depth=estimate.rel_depth,
        ego=estimate.ego,
        velocity=None if ids is None else velocity_map(ids, velocities),
        flow=estimate.flow,
        valid=estimate.valid,
        has_events=estimate.has_events,
    )


def velocity_map(ids: NDArray[np.int32], of_object: dict[int, NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the velocity (H, W, 3) of the object that each pixel shows; 0 where no object has one."""
    table = np.zeros((int(ids.max(initial=0)) + 1, 3))
    for key, velocity in of_object.items():
        if key < len(table):
            table[key] = velocity
    return table[ids]
