"""Moving objects: regions of the motion mask, with ids over slices, measured in sensor pixels."""

import numpy as np
from numpy.typing import NDArray

from evimo.geometry.rectification import Rectification, halved_mask
from evimo.recordings.estimate import Estimate, MovingObject
from evimo.streaming.identities import Identities
from evimo.streaming.inference import Answer
from evimo.streaming.looks import HALF
from evimo.streaming.regions import regions, smallest_region
from evimo.streaming.tallies import extents, weighted_sums
from evimo.streaming.to_sensor import ToSensor

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
U1 = NDArray[np.uint8]


class ObjectFinder:
    """Turns the networks' answers, slice after slice, into estimates in sensor pixels. Remembers ids.

    Objects are found in the networks' own pixels, at half the rectified image's size.

    without_events: how many slices had none.
    """

    def __init__(self, rectification: Rectification, *, wanted: bool = True) -> None:
        """Prepare for a camera; `wanted` is False for a model that says nothing of what moves."""
        self._wanted = wanted
        self._valid = rectification.valid
        whole = tuple(-(-side // HALF) * HALF for side in rectification.image_valid.shape)
        self._inside = halved_mask(rectification.image_valid, (whole[0], whole[1])) > 0
        self._smallest_px = smallest_region(self._inside.shape)
        self._identities = Identities()
        self._to_sensor = ToSensor(rectification, step=HALF)
        self._nothing = np.zeros((2, *self._valid.shape), np.float32)
        self._nothing.flags.writeable = False  # estimates of slices without events share it
        self.without_events = 0

    @property
    def objects_seen(self) -> int | None:
        """How many objects got a new id; None where none are looked for."""
        return self._identities.given if self._wanted else None

    @property
    def objects_lasting(self) -> int | None:
        """How many of them were seen for 0.1 s or longer; None where none are looked for."""
        return self._identities.lasting if self._wanted else None

    def estimate(self, answer: Answer, *, start_us: int, stop_us: int) -> Estimate:
        """Return the estimate of the next slice [start_us, stop_us), from an answer without margin."""
        rel_depth, confidence, *flow = self._to_sensor.bilinear(
            np.concatenate((np.stack((answer.rel_depth, answer.confidence)), answer.flow))
        )
        probability, ids, objects = self._objects(answer, rel_depth)
        return Estimate(
            t_us=(start_us + stop_us) // 2,
            start_us=start_us,
            stop_us=stop_us,
            moving_probability=probability,
            ids=ids,
            rel_depth=rel_depth,
            flow=np.stack(flow),
            confidence=confidence,
            valid=self._valid,
            ego=answer.ego,
            objects=objects,
        )

    def _objects(
        self, answer: Answer, rel_depth: F4
    ) -> tuple[F4, U1, tuple[MovingObject, ...]] | tuple[None, None, None]:
        """Moving probability and ids (H, W), and the objects; nothing of a model that says nothing of what moves."""
        if answer.moving is None or answer.velocity is None:
            return None, None, None
        moving = (answer.moving > 0.5) & self._inside
        labels = regions(moving, answer.velocity, smallest_px=self._smallest_px)
        found = self._identities.follow(labels)
        probability = self._to_sensor.bilinear(answer.moving)
        ids = self._to_sensor.nearest(found)
        ids[~(self._valid & (probability > 0.5))] = 0
        velocities = rel_velocities(found, moving=answer.moving, velocity=answer.velocity)
        return probability, ids, measured(ids, rel_depth, velocities)

    def nothing(self, *, start_us: int, stop_us: int) -> Estimate:
        """Return the estimate of the next slice [start_us, stop_us) if it has no events: nothing is known of it."""
        self.without_events += 1
        self._identities.follow(np.zeros(self._inside.shape, np.uint8))
        empty = self._nothing[0]
        return Estimate(
            t_us=(start_us + stop_us) // 2,
            start_us=start_us,
            stop_us=stop_us,
            moving_probability=empty if self._wanted else None,
            ids=empty.astype(np.uint8) if self._wanted else None,
            rel_depth=empty,
            flow=self._nothing,
            confidence=empty,
            valid=empty > 0,
            ego=np.full(6, np.nan),
            objects=() if self._wanted else None,
            has_events=False,
        )


def measured(ids: U1, rel_depth: F4, velocities: F8) -> tuple[MovingObject, ...]:
    """The objects of an image of ids (H, W), smallest id first; `velocities` (256, 3) holds one for each id."""
    where = extents(ids)
    found: list[MovingObject] = []
    for number in np.flatnonzero(where.area_px).tolist():
        area_px, x0, y0, x1, y1, sum_x, sum_y = (int(column[number]) for column in where)
        box = slice(y0, y1 + 1), slice(x0, x1 + 1)
        found.append(
            MovingObject(
                id=number,
                box=(x0, y0, x1, y1),
                area_px=area_px,
                centroid=(sum_x / area_px, sum_y / area_px),
                rel_distance=_median(rel_depth[box][ids[box] == number]),
                rel_velocity=velocities[number],
            )
        )
    return tuple(found)


def _median(values: F4) -> float:
    """The median of values (N,); NumPy's own spends ten times as long on few values."""
    middle = (len(values) - 1) // 2, len(values) // 2
    return float(np.partition(values, middle)[[*middle]].mean())


def rel_velocities(ids: U1, *, moving: F4, velocity: F4) -> F8:
    """Each id's velocity (256, 3): the mean of `velocity` over its pixels, weighted by moving probability."""
    weight, weighted, _ = weighted_sums(ids, moving, velocity)
    return weighted / np.where(weight > 0, weight, 1)[:, None]
