"""What outlines are aligned with: short stretches of events, and what motion capture and scans know."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.calibrating.contours import Rendered
from evimo.calibrating.sightings import PoseAt
from evimo.events.events import Events

F8 = NDArray[np.float64]
F4 = NDArray[np.float32]
Render = Callable[[float, F8], Rendered]
"""Draw everything at a time of mocap's clock, µs, from a camera at world_from_cam (4, 4)."""


@dataclass(frozen=True, slots=True)
class Moment:
    """Events of some ms, at least one."""

    events: Events

    @property
    def time_us(self) -> float:
        """The middle between the first and the last, camera's clock."""
        return float(self.events.t[0]) / 2 + float(self.events.t[-1]) / 2

    def short_images(self, size: tuple[int, int], short_us: int) -> Iterator[tuple[float, F4]]:
        """Times and images (2, H, W) of how many OFF and ON events each pixel had in short stretches one by one."""
        events, (height, width) = self.events, size
        for start_us in range(int(events.t[0]), int(events.t[-1]) + 1, short_us):
            some = events.between(start_us, start_us + short_us)
            at = ((some.p > 0).astype(np.int64) * height + some.y) * width + some.x
            counts = np.bincount(at, minlength=2 * height * width).astype(np.float32)
            yield start_us + short_us / 2, counts.reshape(2, height, width)

    def counts(self, size: tuple[int, int]) -> F8:
        """How many events each pixel had (H, W)."""
        at = self.events.y.astype(np.int64) * size[1] + self.events.x
        return np.bincount(at, minlength=size[0] * size[1]).reshape(size).astype(np.float64)


@dataclass(frozen=True, slots=True)
class World:
    """What mocap and scans know: the rig, the bodies by id (0, the room, stands still), and how to draw them."""

    rig: PoseAt
    bodies: Mapping[int, PoseAt]
    render: Render

    def body_at(self, body: int, time_us: float) -> tuple[F8, bool]:
        """Where a body is at a time of mocap's clock (4, 4), and whether mocap knew it then."""
        if body not in self.bodies:
            return np.eye(4), body == 0
        poses, known = self.bodies[body](np.array([time_us]))
        return poses[0], bool(known[0])
