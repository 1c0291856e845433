"""The camera's rotation from the recording's gyroscope, slice by slice, where there is one that can be trusted."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evimo.events.alignment import aligned
from evimo.events.gyroscope import Gyroscope
from evimo.events.slices import SLICE_US
from evimo.formats.event_file import EventFile

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]

UNKNOWN = np.zeros(4, np.float32)
ALIGNED_OVER = 160  # slices at most that a gyroscope's axes are found from
SLICE_S = SLICE_US * 1e-6


@dataclass(frozen=True)
class Rotation:
    """What is known of the camera's rotation.

    gyroscope: in camera axes, or None. said: where it comes from, or why there is none, for the summary.
    """

    gyroscope: Gyroscope | None
    said: str

    def of_slice(self, start_us: int, stop_us: int) -> F4:
        """(4,): mean rotation in rad per slice of 25 ms, and 1; or zeros where it is not known."""
        rate = None if self.gyroscope is None else self.gyroscope.mean_rate(start_us, stop_us)
        return UNKNOWN if rate is None else np.append(rate * SLICE_S, 1).astype(np.float32)


NO_ROTATION = Rotation(None, "off")


def rotation_of(events: EventFile, seen: Callable[[], tuple[list[int], F8]]) -> Rotation:
    """The rotation of a recording by its gyroscope.

    One in its own axes is compared with what the events say to find axes, bias and delay. Its scale is left as it is:
    networks see less rotation than there is.

    Args:
        events: the recording.
        seen: gives centres of slices, µs, and the rotation (M, 3) rad/s that the first pass sees in them; called only
            if it is needed.
    """
    gyroscope = events.gyroscope()
    if gyroscope is None:
        return Rotation(None, "the recording has no gyroscope")
    if gyroscope.in_camera_axes:
        return Rotation(gyroscope, f"{gyroscope.source}, in camera axes")
    times_us, rotations = seen()
    found = aligned(gyroscope, np.array(times_us, np.int64), rotations, np.ones(len(times_us)))
    if found is None:
        return Rotation(None, "the gyroscope's axes cannot be told from these events")
    found = replace(found, scale=1.0)
    return Rotation(found.apply(gyroscope), f"{gyroscope.source}: {found}")
