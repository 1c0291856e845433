"""Moving objects: regions of the motion mask, with ids over slices, measured in sensor pixels."""

import numpy as np
from numpy.typing import NDArray

from evimo.geometry.rectification import Rectification
from evimo.recordings.estimate import Estimate, MovingObject
from evimo.streaming.identities import Identities
from evimo.streaming.inference import Answer
from evimo.streaming.regions import regions, smallest_region
from evimo.streaming.tallies import extents, weighted_sums

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
U1 = NDArray[np.uint8]


class ObjectFinder:
    """Turns the networks' answers, slice after slice, into estimates in sensor pixels. Remembers ids."""

    def __init__(self, rectification: Rectification) -> None:
        self._rectification = rectification
        self._smallest_px = smallest_region(rectification.image.size)
        self._identities = Identities()
        self._nearest = _nearest_rectified(rectification)

    @property
    def objects_seen(self) -> int:
        """How many objects got a new id."""
        return self._identities.given

    @property
    def objects_lasting(self) -> int:
        """How many of them were seen for 0.1 s or longer."""
        return self._identities.lasting

    def estimate(self, answer: Answer, *, start_us: int, stop_us: int) -> Estimate:
        """The estimate of the next slice [start_us, stop_us)."""
        moving = (answer.moving > 0.5) & self._rectification.image_valid
        labels = regions(moving, answer.velocity, smallest_px=self._smallest_px)
        rectified_ids = self._identities.follow(labels)
        valid = self._rectification.valid
        maps = np.concatenate((answer.moving[None], answer.rel_depth[None], answer.flow))
        probability, rel_depth, *flow = self._rectification.to_sensor(maps)
        ids = rectified_ids.ravel()[self._nearest]
        ids[~(valid & (probability > 0.5))] = 0
        return Estimate(
            t_us=(start_us + stop_us) // 2,
            start_us=start_us,
            stop_us=stop_us,
            moving_probability=probability,
            ids=ids,
            rel_depth=rel_depth,
            flow=np.stack(flow),
            valid=valid,
            ego=answer.ego,
            objects=measured(ids, rel_depth, rel_velocities(rectified_ids, answer)),
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


def rel_velocities(ids: U1, answer: Answer) -> F8:
    """Each id's velocity (256, 3): the mean over its pixels in the rectified image, weighted by moving probability."""
    weight, weighted, _ = weighted_sums(ids, answer.moving, answer.velocity)
    return weighted / np.where(weight > 0, weight, 1)[:, None]


def _nearest_rectified(rectification: Rectification) -> NDArray[np.intp]:
    """Index of the rectified pixel nearest to each sensor pixel, (H, W), into the flattened rectified image."""
    height, width = rectification.image.size
    column = np.clip(np.floor(rectification.x + 0.5), 0, width - 1).astype(np.intp)
    row = np.clip(np.floor(rectification.y + 0.5), 0, height - 1).astype(np.intp)
    return row * width + column
