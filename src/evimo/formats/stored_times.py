"""Times that lie in an array of their own: their unit, their span, and where to begin reading for a given time.

Only a few of them are read for that, from all over the array; all are where those few do not ascend.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile
from evimo.events.events import Events, no_events
from evimo.formats.clock import Clock, Faults
from evimo.formats.clock_rules import WINDOW_US
from evimo.formats.event_file import refuse_disorder, refuse_strange_times
from evimo.formats.time_units import Times, TimeUnit, as_us, check_span, found_unit, step_of

PIECES, PIECE_EVENTS = 128, 512
END_EVENTS = 1 << 17


class StoredTimes:
    """The times of a recording whose file can be read from any event on.

    unit:     of the stored numbers.
    start_us: the earliest time. stop_us: the latest one + 1.

    Args:
        path: for messages.
        read: the stored times of events first to last, not included.
        count: how many there are.
        pixels: of the sensor.
        repeat: the median time between two events of one pixel, stored; see `repeat_of`.
        said: their unit, where the user says it.
        offset: to be added to the stored numbers, in their unit.

    Raises:
        BadFile: in no unit are they those of a camera, or their order is lost.
    """

    def __init__(
        self,
        path: Path,
        read: Callable[[int, int], NDArray[Any]],
        *,
        count: int,
        pixels: int,
        repeat: float | None,
        said: TimeUnit | None,
        offset: float = 0,
    ) -> None:
        self._read, self._count, self._offset = read, count, offset
        starts = sorted({int(at) for at in np.linspace(0, max(count - PIECE_EVENTS, 0), PIECES)})
        stored = [read(at, min(at + PIECE_EVENTS, count)) for at in starts]
        times = Times(
            [np.asarray(each, np.float64) + offset for each in stored], step_of(np.concatenate(stored)), pixels, repeat
        )
        usual: TimeUnit = "s" if stored[0].dtype.kind == "f" else "us"
        self.unit: TimeUnit = found_unit(path, times, said=said, usual=usual)
        middles = np.array([self._middle_us(at) for at in starts])
        if (middles >= np.maximum.accumulate(middles) - WINDOW_US).all():
            self.start_us, self.stop_us = self._ends(path)
        else:
            self.start_us, self.stop_us = self._surveyed(path)
        refuse_strange_times(path, Faults(), count, self.stop_us - self.start_us)
        if said is None:
            check_span(path, events=count, span_us=self.stop_us - self.start_us, unit=self.unit)

    def between(self, first: int, last: int) -> NDArray[np.int64]:
        """The times of events first to last, in µs."""
        return self.in_us(self._read(first, last))

    def in_us(self, stored: NDArray[Any]) -> NDArray[np.int64]:
        """Stored times in µs, the offset added."""
        return as_us(stored, self.unit) + self.offset_us

    @property
    def offset_us(self) -> int:
        """What is added to all times."""
        return int(as_us(np.array([self._offset]), self.unit)[0])

    def place(self, start_us: int) -> int:
        """The number of an event before which none is at or after start_us, found by halving."""
        first, last = 0, self._count
        while last - first > PIECE_EVENTS:
            middle = (first + last) // 2
            if self._middle_us(middle) + WINDOW_US < start_us:
                first = middle
            else:
                last = middle
        return first

    def _middle_us(self, at: int) -> int:
        """The time around an event, whatever single ones are."""
        return int(np.median(self.between(at, min(at + PIECE_EVENTS, self._count))))

    def _ends(self, path: Path) -> tuple[int, int]:
        first = self._kept(0, END_EVENTS)
        last = self._kept(max(self._count - END_EVENTS, 0), self._count)
        if not len(first) or not len(last) or last.max() < first.min():
            return self._surveyed(path)
        return int(first.min()), int(last.max()) + 1

    def _kept(self, first: int, last: int) -> NDArray[np.int64]:
        return Clock(Faults()).kept(_timed(self.between(first, last)), final=True).t

    def _surveyed(self, path: Path) -> tuple[int, int]:
        """Both ends, from all times."""
        faults = Faults()
        clock, start, stop, kept = Clock(faults), 0, 0, 0
        for at in range(0, self._count + 1, END_EVENTS):
            final = at + END_EVENTS > self._count
            t = clock.kept(_timed(self.between(at, min(at + END_EVENTS, self._count))), final=final).t
            kept = 0 if clock.began_anew else kept
            if len(t):
                start = min(start, int(t.min())) if kept else int(t.min())
                stop = max(stop, int(t.max()) + 1) if kept else int(t.max()) + 1
                kept += len(t)
        refuse_disorder(path, faults, kept)
        if not kept:
            raise BadFile(f"{path.name}: none of its {self._count:,} times is one", fix="export the recording again")
        refuse_strange_times(path, faults, kept, stop - start)
        return start, stop


def _timed(t: NDArray[np.int64]) -> Events:
    """Events of which only the times matter."""
    if not len(t):
        return no_events()
    nowhere = np.zeros(len(t), np.uint16)
    return Events(nowhere, nowhere, t, nowhere.astype(np.int8))
