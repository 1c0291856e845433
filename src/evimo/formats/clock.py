"""The order of a recording's events: sorted within a window, outliers left out, cut where the clock starts again.

What comes out does not depend on how the file is cut into packets: each event is judged by those before it and by the
64 that follow it in the file, and a jump ahead by the 16,384 that follow.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.events.events import Events, joined, no_events
from evimo.formats.clock_rules import (
    ACCEPTED,
    AFTER_RESET,
    AHEAD,
    BACK_NEWEST,
    BACK_RUN,
    DISORDERED,
    KEPT,
    LATE,
    NEWEST,
    NO_TIME,
    OUTLIER,
    WINDOW_US,
)

ENDLESS = 1000  # events that stay behind until the file ends: no late packet, but a clock that started again


@dataclass(slots=True)
class Faults:
    """Events that one pass over a recording had to move or leave out.

    out_of_order: came after a later event, and were sorted into place.
    late:         more than 50 ms older than an event before them, dropped.
    outlying:     their times are far from those around them, or none, dropped.
    after_reset:  came after the recording's clock had started again, dropped.
    outside:      not on the sensor, dropped.
    damaged:      lost between a damaged word and the next that can be trusted.
    reset_us:     the time at which the clock started again; None where it did not.
    """

    out_of_order: int = 0
    late: int = 0
    outlying: int = 0
    after_reset: int = 0
    outside: int = 0
    damaged: int = 0
    reset_us: int | None = None

    @property
    def dropped(self) -> int:
        """Events left out."""
        return self.late + self.outlying + self.after_reset + self.outside + self.damaged

    def parts(self, sensor: tuple[int, int]) -> list[str]:
        """Return the faults in words, with counts; empty where there are none."""
        height, width = sensor
        again = f"its clock starts again after {self.reset_us} µs: the {self.after_reset:,} events from there on were"
        old = f"more than {WINDOW_US // 1000} ms older than those before them"
        parts = {
            f"{self.out_of_order:,} events were out of order and sorted": self.out_of_order,
            f"{self.late:,} events {old} were dropped": self.late,
            f"{self.outlying:,} events with times far from those around them were dropped": self.outlying,
            f"{again} dropped (split the file there to read them)": self.after_reset,
            f"{self.outside:,} events outside the {width}x{height} sensor were dropped": self.outside,
            f"{self.damaged:,} events beside damaged words are lost": self.damaged,
        }
        return [words for words, count in parts.items() if count]


class Clock:
    """Follows the clock of a recording through its packets, and tells which events keep it.

    Args:
        faults: where those left out are counted.
        from_start: whether the packets begin where the recording does; a few events of a clock that starts again
            right after them are then left out rather than all that follow.
    """

    def __init__(self, faults: Faults, *, from_start: bool = True) -> None:
        from evimo.formats.clock_kernel import judge  # loading what is compiled takes longer than all else

        self._judge = judge
        self._faults, self._from_start = faults, from_start
        self._state = _fresh_state()
        self._waiting = no_events()
        self.began_anew, self.in_order = False, True

    @property
    def newest_us(self) -> int:
        """The latest time of all events kept so far; before the first one far in the past."""
        return int(self._state[NEWEST])

    @property
    def reached_us(self) -> int:
        """The latest time of all events so far, those that wait for their verdict included."""
        return max(self.newest_us, int(self._waiting.t.max())) if len(self._waiting) else self.newest_us

    @property
    def is_settled(self) -> bool:
        """Whether what was kept so far cannot be dropped any more."""
        return bool(self._state[ACCEPTED] >= AHEAD)

    def kept(self, packet: Events, *, final: bool = False) -> Events:
        """Return the events, in the file's order, that keep the clock; some wait for the next packet.

        `began_anew` says whether all that was returned before is to be forgotten, `in_order` whether these are sorted
        and none is older than those returned before.
        """
        whole = joined([part for part in (self._waiting, packet) if len(part)])
        verdicts = np.zeros(len(whole), np.uint8)
        self.began_anew, first, before = False, 0, int(self._state[ACCEPTED])
        judged, anew, some_left = self._judge(whole.t, verdicts, self._state, final, self._from_start)
        while anew:
            self._faults.outlying += before + int((verdicts[first:judged] == KEPT).sum())
            self.began_anew, self._from_start, first, before, self._state = True, False, judged, 0, _fresh_state()
            more, anew, left = self._judge(whole.t[first:], verdicts[first:], self._state, final, False)
            judged, some_left = first + more, some_left or left
        self._waiting = whole.part(judged, len(whole))
        self.in_order = not self._state[DISORDERED]
        if not self.in_order:
            self._faults.out_of_order += int(self._state[DISORDERED])
            self._state[DISORDERED] = 0
        if some_left:
            self._count(verdicts[:judged])
        if final:
            self._end()
        kept = whole if (first, judged) == (0, len(whole)) else whole.part(first, judged)
        return _selected(kept, verdicts[first:judged]) if some_left else kept

    def _count(self, verdicts: NDArray[np.uint8]) -> None:
        counts = np.bincount(verdicts, minlength=AFTER_RESET + 1)
        self._faults.late += int(counts[LATE])
        self._faults.outlying += int(counts[OUTLIER])
        if counts[AFTER_RESET]:
            self._cut(int(counts[AFTER_RESET]))

    def _cut(self, count: int) -> None:
        """Events after a reset; the run of late ones before them belongs to it."""
        run = int(self._state[BACK_RUN])
        if self._faults.reset_us is None:
            self._faults.reset_us = self.newest_us
            self._faults.late -= run
            count += run
        self._faults.after_reset += count

    def _end(self) -> None:
        if self._faults.reset_us is None and self._state[BACK_RUN] >= ENDLESS:
            self._cut(0)


def _fresh_state() -> NDArray[np.int64]:
    """The state of a clock that has met no event."""
    state = np.zeros(7, np.int64)
    state[[NEWEST, BACK_NEWEST]] = NO_TIME
    return state


def _selected(events: Events, verdicts: NDArray[np.uint8]) -> Events:
    kept = verdicts == KEPT
    return Events(events.x[kept], events.y[kept], events.t[kept], events.p[kept])


def sorted_packets(packets: Iterator[Events], clock: Clock) -> Iterator[Events]:
    """Sort packets by time, within and across; each waits until no event can come before its last one."""
    held: list[Events] = []
    for packet in packets:
        yield from _advance(held, clock, clock.kept(packet))
    yield from _advance(held, clock, clock.kept(no_events(), final=True))
    yield from held


def _advance(held: list[Events], clock: Clock, packet: Events) -> list[Events]:
    """Take a packet in, and give out those that are complete."""
    if clock.began_anew:
        held.clear()
    if len(packet) and clock.in_order:
        held.append(packet)
    elif len(packet):
        overlapping = [each for each in held if each.t[-1] > packet.t.min()]
        del held[len(held) - len(overlapping) :]
        held.append(_by_time(joined([*overlapping, packet])))
    complete = 0
    while clock.is_settled and complete < len(held) and held[complete].t[-1] <= clock.newest_us - WINDOW_US:
        complete += 1
    ready = held[:complete]
    del held[:complete]
    return ready


def _by_time(packet: Events) -> Events:
    order = np.argsort(packet.t, kind="stable")
    return Events(packet.x[order], packet.y[order], packet.t[order], packet.p[order])
