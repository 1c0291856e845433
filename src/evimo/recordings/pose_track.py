"""Where the camera and the objects of a recording are, exactly."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

F8 = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PoseTrack:
    """Poses of the camera and of every object at M instants, m; camera axes are x right, y down, z forward.

    times_us:        (M,) int64.
    world_from_cam:  (M, 4, 4).
    object_ids:      (K,) uint8.
    cam_from_object: (M, K, 4, 4); an object's origin is the `position` of its truth. Those of an object that motion
                     capture has lost hold NaN.
    """

    times_us: NDArray[np.int64]
    world_from_cam: F8
    object_ids: NDArray[np.uint8]
    cam_from_object: F8

    def part(self, first: int, last: int) -> "PoseTrack":
        """The poses with first <= index < last, as views."""
        cut = slice(first, last)
        return PoseTrack(self.times_us[cut], self.world_from_cam[cut], self.object_ids, self.cam_from_object[cut])

    def in_world_of(self, world_from_start: F8) -> "PoseTrack":
        """The same poses in a world whose origin and axes are a camera's at one instant (4, 4), as the datasets do."""
        return replace(self, world_from_cam=np.linalg.inv(world_from_start) @ self.world_from_cam)


PoseSource = Callable[[NDArray[np.int64]], PoseTrack]
"""Poses at any times in µs; without the instants at which the camera is lost."""
