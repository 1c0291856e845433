"""Who knows what really happened: a recording that stores truth, or whatever else can tell it slice by slice."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from evimo.events.slices import Slice
from evimo.geometry.camera import Camera
from evimo.recordings.pose_track import PoseTrack
from evimo.recordings.recording import Recording
from evimo.recordings.truth import Truth

POSES_US = 5_000  # between poses that are drawn: the 200 Hz of motion capture


class TruthSource(Protocol):
    """Tells truth at the slices that are shown, asked for in their order."""

    @property
    def camera(self) -> Camera:
        """Of the sensor."""
        ...

    def poses(self, start_us: int, stop_us: int) -> PoseTrack | None:
        """Where the camera and the objects are from one time to another; None where nobody knows."""
        ...

    def some(self) -> Iterable[Truth]:
        """A few instants, to choose the colours of depth by."""
        ...

    def at(self, part: Slice) -> Truth | None:
        """The truth of a slice; None where nobody knows it."""
        ...


@dataclass(frozen=True, slots=True)
class StoredTruth:
    """The truth that a recording stores."""

    recording: Recording

    @property
    def camera(self) -> Camera:
        """Of the sensor."""
        return self.recording.camera

    def poses(self, start_us: int, stop_us: int) -> PoseTrack | None:
        """The poses every 5 ms, as far as they are known; None where the recording has none."""
        paths = self.recording.paths
        return None if paths is None else paths.poses(np.arange(start_us, stop_us, POSES_US, dtype=np.int64))

    def some(self) -> Iterable[Truth]:
        """The first instant, the middle and the last."""
        count = len(self.recording)
        return (self.recording.truth(k) for k in sorted({0, count // 2, count - 1}) if 0 <= k < count)

    def at(self, part: Slice) -> Truth | None:
        """The truth of the middle of the slice, from the instant nearest to it."""
        return self.recording.truth_at(part.centre_us)


@dataclass(frozen=True, slots=True)
class Shape:
    """A scan as it is shown: points (N, 3) in m, and triangles (T, 3) of them, none where it is a cloud.

    object_id: whose; 0 is the room's.
    body_from_scan: (4, 4), into the object's axes of its poses, or into the world.
    """

    object_id: int
    points: NDArray[np.floating]
    triangles: NDArray[np.integer]
    body_from_scan: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Markers:
    """The markers of one body that motion capture saw: times (M,) in µs, places (M, K, 3) in the world, visible (M, K).

    body: its name.
    """

    body: str
    times_us: NDArray[np.int64]
    position: NDArray[np.float64]
    visible: NDArray[np.bool_]
