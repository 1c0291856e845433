"""Events of one sensor as four arrays."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Events:
    """Events of one sensor are four arrays of one length, sorted by time.

    x, y: column and row, (N,) uint16; the integer (0, 0) is the centre of the top-left pixel.
    t:    µs in the file's own clock, never shifted, (N,) int64.
    p:    polarity, (N,) int8: +1 brighter, -1 darker.
    """

    x: NDArray[np.uint16]
    y: NDArray[np.uint16]
    t: NDArray[np.int64]
    p: NDArray[np.int8]

    def __len__(self) -> int:
        return len(self.t)

    def between(self, start_us: int, stop_us: int) -> "Events":
        """The events with start_us <= t < stop_us, as views."""
        return self.part(*np.searchsorted(self.t, (start_us, stop_us)).tolist())

    def part(self, first: int, last: int) -> "Events":
        """The events with first <= index < last, as views."""
        cut = slice(first, last)
        return Events(self.x[cut], self.y[cut], self.t[cut], self.p[cut])


def no_events() -> Events:
    """Zero events."""
    return Events(np.zeros(0, np.uint16), np.zeros(0, np.uint16), np.zeros(0, np.int64), np.zeros(0, np.int8))


def joined(packets: Sequence[Events]) -> Events:
    """Packets that follow each other in time as one."""
    filled = [packet for packet in packets if len(packet)]
    if len(filled) < 2:
        return filled[0] if filled else no_events()
    return Events(
        np.concatenate([packet.x for packet in filled]),
        np.concatenate([packet.y for packet in filled]),
        np.concatenate([packet.t for packet in filled]),
        np.concatenate([packet.p for packet in filled]),
    )
