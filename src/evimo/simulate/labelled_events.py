"""Events that know which object their pixel sees."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.events.events import Events, joined
from evimo.scene.rays.film import TILE
from evimo.scene.renderer import Frames, Renderer

F8 = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LabelledEvents:
    """Events, sorted by time, and the id of what each one's pixel saw at its time, (N,) uint8; 0 is static."""

    events: Events
    ids: NDArray[np.uint8]

    def merged(self, later: "LabelledEvents") -> "LabelledEvents":
        """Both, sorted by time; of equal times, these come first."""
        events = joined([self.events, later.events])
        order = np.argsort(events.t, kind="stable")
        events = Events(events.x[order], events.y[order], events.t[order], events.p[order])
        return LabelledEvents(events, np.concatenate((self.ids, later.ids))[order])

    def between(self, start_us: int, stop_us: int) -> "LabelledEvents":
        """Those with start_us <= t < stop_us, as views."""
        first, last = np.searchsorted(self.events.t, (start_us, stop_us)).tolist()
        return LabelledEvents(self.events.part(first, last), self.ids[first:last])


def ids_of(
    events: Events, renderer: Renderer, frames: Frames, *, time_s: F8, strides: NDArray[np.int32]
) -> NDArray[np.uint8]:
    """The id that each event's pixel sees in the frame nearest to the event, of those in which its tile was cast.

    frames: at equally spaced times (F,). strides: (R, C), each tile was cast in every so many of them.
    """
    stride = strides[events.y // TILE, events.x // TILE]
    passed = (events.t * 1e-6 - time_s[0]) / (time_s[1] - time_s[0])
    frame = (np.rint(passed / stride) * stride).clip(0, len(time_s) - 1).astype(np.int64)
    parts = frames.tags[frame, events.y, events.x] >> 3
    seen = (parts >= 0) & renderer.lens[1][events.y, events.x]
    return np.where(seen, renderer.packed.ids[np.maximum(parts, 0)], 0).astype(np.uint8)
