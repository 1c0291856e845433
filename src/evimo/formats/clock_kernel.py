# pyright: basic
"""Which events keep the clock of their recording, compiled: one pass, with a look ahead where the clock jumps."""

import numpy as np

from evimo.compiling import njit
from evimo.formats.clock_rules import (
    ACCEPTED,
    AFTER_RESET,
    AHEAD,
    ANEW,
    BACK_NEWEST,
    BACK_RUN,
    CUT,
    DISORDERED,
    KEPT,
    LATE,
    LONG_US,
    LONGEST_BLOCK,
    MOST_US,
    NEWEST,
    NO_TIME,
    OLDEST,
    OUTLIER,
    WAITING,
    WINDOW_US,
)


@njit(nogil=True, error_model="numpy")
def before(times, first, last, limit):
    """How many of times[first:last] lie before a limit, and how many are times at all."""
    earlier, valid = 0, 0
    for at in range(first, last):
        if -MOST_US < times[at] < MOST_US:
            valid += 1
            earlier += times[at] < limit
    return earlier, valid


@njit(nogil=True, error_model="numpy")
def accepted(time, state):
    """Let the clock follow an event."""
    first = state[ACCEPTED] == 0
    state[OLDEST] = time if first else min(state[OLDEST], time)
    state[DISORDERED] += time < state[NEWEST]
    state[NEWEST] = max(state[NEWEST], time)
    state[ACCEPTED] += 1
    state[BACK_NEWEST], state[BACK_RUN] = NO_TIME, 0
    return KEPT


@njit(nogil=True, error_model="numpy")
def on_clock(time, state):
    """Keep an event inside the window, unless a clock that went back has climbed there: a second recording."""
    climbed = state[BACK_RUN] > AHEAD and state[BACK_NEWEST] >= state[NEWEST] - 2 * WINDOW_US
    if climbed:
        state[CUT] = 1
        return AFTER_RESET
    return accepted(time, state)


@njit(nogil=True, error_model="numpy")
def is_strange_block(times, at, newest):
    """Whether a block ahead of the clock begins: after it as many events go on where the clock was before."""
    limit, stop, last = times[at] - WINDOW_US, at + 1, min(at + LONGEST_BLOCK, len(times))
    while stop < last and not newest - WINDOW_US <= times[stop] < limit:
        stop += 1
    length = stop - at
    if stop == last or 2 * length < AHEAD:  # shorter ones are told by the majority of those that follow
        return False
    earlier, _ = before(times, stop, min(stop + length, len(times)), limit)
    return 2 * earlier > length


@njit(nogil=True, error_model="numpy")
def ahead_of_clock(times, at, state, final):
    """An event after a pause, or the first one: what those that follow say of it."""
    last = min(at + 1 + AHEAD, len(times))
    if last - at - 1 < AHEAD and not final:
        return WAITING
    earlier, valid = before(times, at + 1, last, times[at] - WINDOW_US)
    if 2 * earlier > valid:
        return OUTLIER
    if state[ACCEPTED] > 0:
        if len(times) - at <= 2 * LONGEST_BLOCK and not final:
            return WAITING
        if is_strange_block(times, at, state[NEWEST]):
            return OUTLIER
    count, length = state[ACCEPTED], state[NEWEST] - state[OLDEST]
    if count > 0 and times[at] - state[NEWEST] > max(LONG_US, length):
        if count < AHEAD and valid == AHEAD:
            return ANEW
        if valid < AHEAD and 8 * (valid + 1) <= count:
            return OUTLIER
    return accepted(times[at], state)


@njit(nogil=True, error_model="numpy")
def behind_clock(times, at, state, final, from_start):
    """An event older than the window: one of a clock that went back, if all that follow are; else a late one."""
    if from_start and state[NEWEST] - state[OLDEST] <= WINDOW_US and state[BACK_RUN] == 0:
        last = min(at + 1 + AHEAD, len(times))
        if last - at - 1 < AHEAD and not final:
            return WAITING
        earlier, valid = before(times, at + 1, last, state[NEWEST] - WINDOW_US)
        if valid == AHEAD and earlier == valid:
            return ANEW
    state[BACK_RUN] += 1
    state[BACK_NEWEST] = max(state[BACK_NEWEST], times[at])
    return LATE


@njit(nogil=True, error_model="numpy")
def in_step(times, at, newest):
    """The position after all events from `at` on that follow each other in order and without a pause.

    Of 256 at a time, as most are: a step back or a long one shows in a sign.
    """
    if not newest <= times[at] <= newest + WINDOW_US:
        return at
    at += 1
    while at + 256 <= len(times):
        later, sooner, out_of_step = times[at : at + 256], times[at - 1 : at + 255], np.int64(0)
        for number in range(256):
            step = later[number] - sooner[number]
            out_of_step |= step | (WINDOW_US - step)
        if out_of_step < 0:
            break
        at += 256
    while at < len(times) and times[at - 1] <= times[at] <= times[at - 1] + WINDOW_US:
        at += 1
    return at


@njit(nogil=True, error_model="numpy")
def judged(times, at, state, final, from_start):
    """The verdict on one event."""
    time, newest = times[at], state[NEWEST]
    if state[CUT]:
        return AFTER_RESET
    if not -MOST_US < time < MOST_US:
        return OUTLIER
    if state[ACCEPTED] == 0 or time > newest + WINDOW_US:
        return ahead_of_clock(times, at, state, final)
    if time >= newest - WINDOW_US:
        return on_clock(time, state)
    return behind_clock(times, at, state, final, from_start)


@njit(nogil=True, error_model="numpy")
def judge(times, verdicts, state, final, from_start):
    """Write a verdict for each event but the last ones, which wait for those that follow unless this is the end.

    Returns how many were judged; whether the clock begins anew there, as what came before were a few events of another
    clock, to be dropped by the caller, who calls again from there; and whether any event is not kept.
    """
    at, changed = np.int64(0), False  # a plain 0 has the functions below compiled for zero, too
    while at < len(times):
        if state[ACCEPTED] > 0 and state[BACK_RUN] == 0:
            after = in_step(times, at, state[NEWEST])
            if after > at:
                state[ACCEPTED] += after - at
                state[NEWEST] = times[after - 1]
                at = after
                continue
        verdict = judged(times, at, state, final, from_start)
        if verdict >= WAITING:
            return at, verdict == ANEW, changed
        verdicts[at] = verdict
        changed |= verdict != KEPT
        at += 1
    return at, False, changed
