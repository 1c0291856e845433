"""What the model says of one slice, in sensor pixels."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.events.events import Events


@dataclass(frozen=True, slots=True)
class MovingObject:
    """One independently moving object in one slice.

    id:           kept over slices by overlap; 1 and up.
    box:          x0, y0, x1, y1 in sensor px, the last column and row included.
    area_px:      pixels of its mask.
    centroid:     (x, y) in sensor px.
    rel_distance: median relative depth over its mask.
    rel_velocity: (3,) its velocity relative to the static world, camera axes, in mean depths per second.
    """

    id: int
    box: tuple[int, int, int, int]
    area_px: int
    centroid: tuple[float, float]
    rel_distance: float
    rel_velocity: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class EventLabels:
    """The events of one slice, and the object that each belongs to.

    events:  all events of the slice, on the sensor.
    objects: (N,) uint8 beside them, 0 is background, else `MovingObject.id`.
    """

    events: Events
    objects: NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Estimate:
    """An estimate says what moved, how far things were and how the camera moved in one slice [start_us, stop_us).

    All is valid at the slice's centre; maps are in sensor pixels (H, W). A model that does not estimate what moves by
    itself (`ecn`) leaves `moving_probability`, `ids`, `moving` and `objects` out: they are None.

    moving_probability: (H, W) float32, 0...1; the motion mask is where it exceeds 0.5.
    ids:        (H, W) uint8, 0 is background, else `MovingObject.id`.
    rel_depth:  (H, W) float32 along the optical axis, mean 1 over the rectified image.
    flow:       (2, H, W) float32, image velocity on the plane Z = 1, in 1/s.
    confidence: (H, W) float32, 0...1, in the flow: how much each pixel counted when the motions were fitted to it.
                Low where events are few or say little; no probability.
    valid:      (H, W) bool, False where the lens has no rectified counterpart: the maps say nothing there.
    ego:        (6,) the camera's twist relative to the static world, camera axes:
                translation in mean depths per second, rotation in rad/s.
    objects:    the moving objects of this slice.
    event_labels: of the slice's events; None unless asked for.
    has_events: False where the slice has no event: then nothing is known, `valid` is False and `ego` is NaN everywhere.
    """

    t_us: int
    start_us: int
    stop_us: int
    moving_probability: NDArray[np.float32] | None
    ids: NDArray[np.uint8] | None
    rel_depth: NDArray[np.float32]
    flow: NDArray[np.float32]
    confidence: NDArray[np.float32]
    valid: NDArray[np.bool_]
    ego: NDArray[np.float64]
    objects: tuple[MovingObject, ...] | None
    event_labels: EventLabels | None = None
    has_events: bool = True

    @property
    def moving(self) -> NDArray[np.bool_] | None:
        """The motion mask, (H, W)."""
        return None if self.moving_probability is None else (self.moving_probability > 0.5) & self.valid
