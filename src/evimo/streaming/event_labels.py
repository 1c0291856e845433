"""A label for every event: which of the slice's moving objects it belongs to."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.events.events import Events
from evimo.geometry.rectification import Rectification
from evimo.recordings.estimate import Estimate, EventLabels, MovingObject
from evimo.streaming.layers import Followed, follow, mask_prior, motion_at, start_motion
from evimo.streaming.nearby import Nearby, events_near, world_of

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]

REACH_PX = 6.0  # how far an object may move between the centre and either end of its window
SHORTEST, LONGEST = 0.5, 1.5  # slices from the centre to either end of it
AROUND_PX = 8  # that a box reaches beyond the mask and what the object moves


class _Object(NamedTuple):
    """One object in the rectified image: its motion as the network sees it, and where that is.

    pixels: (2, N) rows and columns of its mask on the sensor; x, y: their px in the rectified image.
    motion: (4,) as in `sharpness`, about `centre`.
    """

    id: int
    pixels: tuple[NDArray[np.intp], NDArray[np.intp]]
    x: F4
    y: F4
    centre: tuple[float, float]
    motion: F8


class EventLabeller:
    """Labels the events of slices, and sharpens the motion of their objects; made once per camera.

    It works in the rectified image, where straight motions stay straight, and remembers nothing.
    """

    def __init__(self, rectification: Rectification) -> None:
        self._rectification = rectification
        image = rectification.image
        self._focal_px = np.array((image.fx, image.fy))

    def label(self, estimate: Estimate, window: Events) -> Estimate:
        """The estimate with `event_labels`, and with the flow and velocity of its objects sharpened.

        Args:
            estimate: of a slice.
            window: the events of the slice, and of the slices before and after it as far as there are any.
        """
        first, last = np.searchsorted(window.t, (estimate.start_us, estimate.stop_us)).tolist()
        if not estimate.has_events:
            return replace(estimate, event_labels=EventLabels(window.part(first, last), np.zeros(0, np.uint8)))
        best, names = np.ones(len(window), np.float32), np.zeros(len(window), np.uint8)
        flow, objects = estimate.flow.copy(), list[MovingObject]()
        for moving in estimate.objects or ():
            seen = self._seen(moving, estimate)
            near, followed = self._followed(seen, estimate, window)
            won = followed.odds > best[near.index]
            best[near.index[won]], names[near.index[won]] = followed.odds[won], moving.id
            if followed.sharper:
                moving = self._sharpened(moving, seen, followed.motion, estimate=estimate, flow=flow)
            objects.append(moving)
        labels = EventLabels(window.part(first, last), names[first:last].copy())
        return replace(estimate, flow=flow, objects=tuple(objects), event_labels=labels)

    def _seen(self, moving: MovingObject, estimate: Estimate) -> _Object:
        x0, y0, x1, y1 = moving.box
        ids, _ = _masks(estimate)
        rows, columns = np.nonzero(ids[y0 : y1 + 1, x0 : x1 + 1] == moving.id)
        pixels = rows + y0, columns + x0
        x, y = self._rectification.x[pixels], self._rectification.y[pixels]
        centre = float(x.mean()), float(y.mean())
        flow = self._per_slice(estimate)[:, None] * estimate.flow[:, *pixels]
        return _Object(moving.id, pixels, x, y, centre, start_motion(flow, x, y, centre))

    def _followed(self, seen: _Object, estimate: Estimate, window: Events) -> tuple[Nearby, Followed]:
        """The events near an object, and which of them follow it."""
        speed = float(np.hypot(*seen.motion[:2]))
        reach = float(np.clip(REACH_PX / max(speed, 1e-3), SHORTEST, LONGEST))
        wide = AROUND_PX + speed * reach
        height, width = self._rectification.image.size
        left, top = max(0, int(seen.x.min() - wide)), max(0, int(seen.y.min() - wide))
        right, bottom = min(width, int(seen.x.max() + wide) + 1), min(height, int(seen.y.max() + wide) + 1)
        box = left, top, right, bottom
        near = events_near(window, world_of(estimate, self._rectification), box=box, reach=reach)
        place = slice(top, bottom), slice(left, right)
        source, exists = self._rectification.source[place], self._rectification.image_valid[place]
        ids, probability = (np.where(exists, each.ravel()[source], each.dtype.type(0)) for each in _masks(estimate))
        mine = ids == seen.id
        prior = mask_prior(probability, mine, (ids > 0) & ~mine)
        centre = seen.centre[0] - left, seen.centre[1] - top
        return near, follow(near, prior, seen.motion, centre)

    def _sharpened(
        self, moving: MovingObject, seen: _Object, motion: F8, *, estimate: Estimate, flow: F4
    ) -> MovingObject:
        """The object with its velocity along the image changed by what its flow changed; that flow goes into `flow`.

        One image says nothing new of its depth, nor of its velocity towards the camera.
        """
        found = motion_at(motion, seen.x, seen.y, seen.centre) / self._per_slice(estimate)[:, None]
        change = (found - flow[:, *seen.pixels]).mean(axis=1, dtype=np.float64)
        flow[:, *seen.pixels] = found
        velocity = moving.rel_velocity + np.append(change, 0) * moving.rel_distance
        return replace(moving, rel_velocity=velocity)

    def _per_slice(self, estimate: Estimate) -> F4:
        """Px per slice in the rectified image that 1/s on the plane Z = 1 is, (2,)."""
        return (self._focal_px * (estimate.stop_us - estimate.start_us) * 1e-6).astype(np.float32)


def _masks(estimate: Estimate) -> tuple[NDArray[np.uint8], F4]:
    """The ids and the moving probability of an estimate that has objects."""
    if estimate.ids is None or estimate.moving_probability is None:
        raise ValueError("events belong to objects, and this model finds none")
    return estimate.ids, estimate.moving_probability
