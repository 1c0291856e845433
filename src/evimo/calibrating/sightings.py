"""What a camera saw of a target that mocap tracks too: pixels, the target's points, and when."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.calibrating.rigid import inverse, moved

F8 = NDArray[np.float64]
PoseAt = Callable[[F8], tuple[F8, NDArray[np.bool_]]]
"""Poses `world_from_body` (F, 4, 4) at times (F,) of mocap's clock, µs, and where they are known (F,)."""


@dataclass(frozen=True, slots=True)
class Mocap:
    """Where mocap saw the rig that carries the camera, and the target."""

    world_from_rig: PoseAt
    world_from_target: PoseAt

    def rig_from_target(self, times_us: F8) -> tuple[F8, NDArray[np.bool_]]:
        """The target's pose on the rig's axes (F, 4, 4) at times (F,) of mocap's clock, and where both are known."""
        (world_from_rig, has_rig), (world_from_target, has_target) = (
            poses(times_us) for poses in (self.world_from_rig, self.world_from_target)
        )
        return inverse(world_from_rig) @ world_from_target, has_rig & has_target


@dataclass(frozen=True, slots=True)
class Sightings:
    """Points of the target that were found in images.

    times_us: (F,): of the images, camera's clock.
    image:    (N,): number of the image in which each point was found.
    points:   (N, 3): the points, m, on the target's own axes.
    px:       (N, 2): where they were found; x first.
    """

    times_us: F8
    image: NDArray[np.int64]
    points: F8
    px: F8

    def __len__(self) -> int:
        return len(self.px)

    def where(self, kept: NDArray[np.bool_]) -> "Sightings":
        """Those of the points (N,) that are kept."""
        return Sightings(self.times_us, self.image[kept], self.points[kept], self.px[kept])

    def on_rig(self, rig_from_target: F8) -> F8:
        """The points (N, 3) on the rig's axes, the target being where (F, 4, 4) say."""
        return moved(rig_from_target[self.image], self.points[:, None])[:, 0]
