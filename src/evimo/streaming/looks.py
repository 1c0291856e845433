"""What both passes look at: the events of a stack in the rectified image, as voxel grids and plane fits."""

import threading
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from evimo.events.events import Events
from evimo.events.slices import SLICE_US, Slice
from evimo.events.stack import CELL, VOXELS, EventStack, StaticMotion, compensated, plane_fits, voxel_grid
from evimo.geometry.rectification import Rectification, halved_mask
from evimo.streaming.inference import CameraMotion, Seen
from evimo.streaming.span import STACKED

F4 = NDArray[np.float32]

HALF = 2  # px of the rectified image per pixel of the answer
QUARTER = 4  # and of the first pass's answer


class Placed:
    """Brings slices to the rectified image; counts the events that have no place in it.

    dropped: so far.
    """

    def __init__(self, rectification: Rectification) -> None:
        self._at = rectification
        self.dropped = 0

    def slice(self, part: Slice) -> EventStack:
        """The events of one slice, time about its own centre."""
        events: Events = part.events
        inside = (events.y < self._at.valid.shape[0]) & (events.x < self._at.valid.shape[1])
        x, y = events.x[inside], events.y[inside]
        kept = self._at.valid[y, x]
        x, y = x[kept], y[kept]
        since = events.t[inside][kept] - part.centre_us
        self.dropped += len(events) - len(x)
        positive = events.p[inside][kept] > 0
        return EventStack(self._at.x[y, x], self._at.y[y, x], (since / SLICE_US).astype(np.float32), positive)


class Looks:
    """Makes what the passes look at; for any number of threads, each of which keeps memory of its own."""

    def __init__(self, rectification: Rectification, *, stride: int) -> None:
        height, width = (-(-side // stride) * stride for side in rectification.image.size)
        self.size = height, width
        self.cells = height // CELL, width // CELL
        self._valid = halved_mask(rectification.image_valid, self.size)
        image = rectification.image
        self._intrinsics = np.array((image.fx, image.fy, image.cx, image.cy), np.float32)
        self._memory = threading.local()

    def first(self, stack: EventStack, rotation: F4) -> Seen:
        """The events as they come, at half the rectified image's size."""
        return self._seen(stack, self.cells, rotation, step=CELL)

    def static_motion(self, motions: Sequence[CameraMotion]) -> StaticMotion:
        """How the static world moves by what the first pass says of five slices, at the middle one's depth."""
        twist = np.stack([motion.ego for motion in motions]).astype(np.float32)
        return StaticMotion(twist, np.reciprocal(motions[STACKED // 2].rel_depth), QUARTER, self._intrinsics)

    def second(self, stack: EventStack, motion: StaticMotion, rotation: F4) -> Seen:
        """The events without the camera's motion."""
        return self._seen(compensated(stack, motion), self.size, rotation, step=1)

    def _seen(self, stack: EventStack, size: tuple[int, int], rotation: F4, *, step: int) -> Seen:
        voxels = voxel_grid(stack, size, step=step, out=self._grid(size))
        return Seen(voxels, plane_fits(stack, self.cells), self._valid, self._intrinsics, rotation)

    def _grid(self, size: tuple[int, int]) -> F4:
        """A voxel grid's memory: fresh pages for each slice would take longer than filling them."""
        kept: dict[tuple[int, int], F4] = self._memory.__dict__.setdefault("grids", {})
        if size not in kept:
            kept[size] = np.empty((VOXELS, *size), np.float32)
        return kept[size]


def stacked(parts: Sequence[EventStack | None]) -> EventStack:
    """The stack of slices around a middle one, whose times are about their own centres; None is a missing slice."""
    half = len(parts) // 2
    there = [(number - half, part) for number, part in enumerate(parts) if part is not None]
    if not there:
        nothing = np.zeros(0, np.float32)
        return EventStack(nothing, nothing, nothing, np.zeros(0, np.bool_))
    columns = zip(*((part.x, part.y, part.t + np.float32(away), part.positive) for away, part in there), strict=True)
    return EventStack(*(np.concatenate(column) for column in columns))
