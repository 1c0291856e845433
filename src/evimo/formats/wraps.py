"""Counters of 24, 31 and 32 bits that start over in files of plain numbers, where no format tells how many bits."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.formats.clock_rules import NO_TIME, WINDOW_US

ROUNDS = {(0, 1 << 24): 1 << 24, (0, 1 << 31): 1 << 31, (0, 1 << 32): 1 << 32, (-(1 << 31), 1 << 31): 1 << 32}
SHORTEST_US = 1 << 23  # of what may be a wrap


class Reached(NamedTuple):
    """Where a counter is: the time of the last event as stored, and what is added to it, both in µs."""

    stored_us: int = NO_TIME
    added_us: int = 0


def continued(t: NDArray[np.int64], reached: Reached) -> tuple[NDArray[np.int64], Reached]:
    """Return times that follow those of before, with the rounds of their counter added, and where it is then.

    A step is a wrap where it begins within 50 ms of the largest number that the bits hold and ends within 50 ms of the
    smallest; a clock that starts again hits both by chance alone. The same step back is one of events out of order.
    """
    if not len(t):
        return t, reached
    before = np.concatenate((np.array([reached.stored_us]), t[:-1]))
    last, added = int(t[-1]), reached.added_us
    places = np.flatnonzero(np.abs((t >> 1) - (before >> 1)) >= SHORTEST_US >> 1)  # halves: no step overflows
    parts, start = list[NDArray[np.int64]](), 0
    for at in places.tolist():
        round_us = _round(int(before[at]), int(t[at])) or -_round(int(t[at]), int(before[at]))
        if round_us and added + round_us >= 0:
            parts.append(_plus(t[start:at], added))
            start, added = at, added + round_us
    if not parts and not added:
        return t, Reached(last, 0)
    return np.concatenate((*parts, _plus(t[start:], added))), Reached(last, added)


def _round(before_us: int, after_us: int) -> int:
    """By how much a counter went on that wrapped between two times; 0 where it did not."""
    for (lowest, top), round_us in ROUNDS.items():
        if 0 < top - before_us <= WINDOW_US and 0 <= after_us - lowest < WINDOW_US:
            return round_us
    return 0


def _plus(t: NDArray[np.int64], added_us: int) -> NDArray[np.int64]:
    return np.where(t == NO_TIME, t, t + added_us)
