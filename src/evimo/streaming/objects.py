"""Moving objects: regions of the motion mask, with ids over slices, measured in sensor pixels."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import find_objects

from evimo.geometry.rectification import Rectification
from evimo.recordings.estimate import Estimate, MovingObject
from evimo.streaming.identities import Identities
from evimo.streaming.inference import Answer
from evimo.streaming.regions import regions, smallest_region

F4 = NDArray[np.float32]
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


def measured(ids: U1, rel_depth: F4, velocities: dict[int, NDArray[np.float64]]) -> tuple[MovingObject, ...]:
    """The objects of an image of ids (H, W), smallest id first; `velocities` holds (3,) for each id."""
    found: list[MovingObject] = []
    for number, box in enumerate(find_objects(ids), start=1):
        if box is None:
            continue
        mask = ids[box] == number
        y0, x0 = box[0].start, box[1].start
        area_px = int(np.count_nonzero(mask))
        x = x0 + float(mask.sum(axis=0) @ np.arange(mask.shape[1])) / area_px
        y = y0 + float(mask.sum(axis=1) @ np.arange(mask.shape[0])) / area_px
        found.append(
            MovingObject(
                id=number,
                box=(x0, y0, box[1].stop - 1, box[0].stop - 1),
                area_px=area_px,
                centroid=(x, y),
                rel_distance=float(np.median(rel_depth[box][mask])),
                rel_velocity=velocities[number],
            )
        )
    return tuple(found)


def rel_velocities(ids: U1, answer: Answer) -> dict[int, NDArray[np.float64]]:
    """Each id's velocity (3,): the mean over its pixels in the rectified image, weighted by moving probability."""
    velocities: dict[int, NDArray[np.float64]] = {}
    for number, box in enumerate(find_objects(ids), start=1):
        if box is not None:
            mask = ids[box] == number
            weights = answer.moving[box][mask].astype(np.float64)
            velocities[number] = answer.velocity[:, *box][:, mask] @ weights / weights.sum()
    return velocities


def _nearest_rectified(rectification: Rectification) -> NDArray[np.intp]:
    """Index of the rectified pixel nearest to each sensor pixel, (H, W), into the flattened rectified image."""
    height, width = rectification.image.size
    column = np.clip(np.floor(rectification.x + 0.5), 0, width - 1).astype(np.intp)
    row = np.clip(np.floor(rectification.y + 0.5), 0, height - 1).astype(np.intp)
    return row * width + column
