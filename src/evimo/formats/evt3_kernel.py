# pyright: basic
"""Prophesee's EVT 3.0, words of 16 bits, compiled: the same for RAW files and for messages of ROS.

The upper 4 bits are the kind of a word: 0 row, 2 column and polarity, 3 base column and polarity, 4 and 5 vectors of
12 and 8 pixels from the base on, 6 and 8 the lower and the upper 12 bits of the time in µs; triggers, continuations
and the rest carry no events.
"""

import numpy as np
from numba import njit

from evimo.formats.evt_clock_kernel import (
    CLOCK,
    CLOCK_STATE,
    EXPECTED,
    LOST,
    UNDECIDED,
    UNKNOWN,
    advance,
    believed_clocks,
)

BITS = 12
NEAR = 64  # units of 4.096 ms
SOONER_US = 1 << 20  # the first time is before `expected_us`, or later by less than this

# What EVT 3 keeps from one block of words to the next, after what its clock keeps.
LOW, TOP, BEFORE, SOUND, ROW, BASE, POLARITY, STATE_SIZE = (CLOCK_STATE + at for at in range(8))


@njit(cache=True, nogil=True)
def evt3_state(expected_us):
    """The state before the first word; the sensor's 24-bit clock is placed in the last round before expected_us."""
    state = np.zeros(STATE_SIZE, np.int64)
    state[CLOCK] = state[LOW] = state[TOP] = state[BEFORE] = UNKNOWN
    state[EXPECTED] = (expected_us + SOONER_US) >> BITS
    return state


@njit(cache=True, nogil=True)
def counted(words):
    """How many events there are at most, and the values and positions of the TIME HIGH words."""
    events, highs = 0, 0
    for code in words:
        kind = code >> 12
        events += (kind == 2) + 12 * (kind == 4) + 8 * (kind == 5)
        highs += kind == 8
    values, places = np.empty(highs, np.int64), np.empty(highs, np.int64)
    highs = 0
    for at in range(len(words)):
        if words[at] >> 12 == 8:
            values[highs], places[highs] = words[at] & 0xFFF, at
            highs += 1
    return events, values, places


@njit(cache=True, nogil=True)
def settled(words, clocks, places):
    """Up to which word all can be told: two TIME LOW words must follow it, and no clock be undecided."""
    stop, lows = len(words), 0
    for at in range(len(clocks)):
        if clocks[at] == UNDECIDED:
            stop = places[at]
            break
    while stop > 0 and lows < 2:
        stop -= 1
        lows += words[stop] >> 12 == 6
    return stop


@njit(cache=True, nogil=True)
def next_low(words, at):
    """The next TIME LOW after number `at`, UNKNOWN if a TIME HIGH or the end comes first."""
    for other in range(at + 1, len(words)):
        if words[other] >> 12 == 6:
            return np.int64(words[other] & 0xFFF)
        if words[other] >> 12 == 8:
            return np.int64(UNKNOWN)
    return np.int64(UNKNOWN)


@njit(cache=True, nogil=True)
def decode_evt3(words, state, final):
    """Events of EVT 3 words (u2) after the first whole time, how many words were used, and how many events are lost.

    The words that were not used must be given again, before those that follow; where none follow, `final` says so.
    Within one TIME HIGH the lower bits only grow: those followed by lower ones, or lower than those before, are lost.
    """
    most, values, places = counted(words)
    clocks = believed_clocks(values, state, BITS, NEAR, final)
    stop = len(words) if final else settled(words, clocks, places)
    x, y = np.empty(most + 12, np.uint16), np.empty(most + 12, np.uint16)
    t, p = np.empty(most + 12, np.int64), np.empty(most + 12, np.int8)
    low, top, before, sound = state[LOW], state[TOP], state[BEFORE], state[SOUND]
    row, base, polarity = state[ROW], state[BASE], state[POLARITY]
    high, now = state[CLOCK], state[CLOCK] << BITS | max(low, 0)
    kept, count, lost, mark, number = sound == 1 and low >= 0, 0, 0, 0, 0
    missed = sound == 2 or (sound == 1 and low == LOST)
    for at in range(stop):
        kind, value = words[at] >> 12, np.int64(words[at] & 0xFFF)
        if kind == 2:
            x[count], y[count], t[count], p[count] = value & 0x7FF, row, now, 2 * (value >> 11) - 1
            count, lost = count + kept, lost + missed
        elif kind == 4 or kind == 5:
            width = 12 if kind == 4 else 8
            for step in range(width):
                x[count], y[count], t[count], p[count] = base + step, row, now, polarity
                bit = value >> step & 1
                count, lost = count + (bit & kept), lost + (bit & missed)
            base += width
        elif kind == 0:
            row = value & 0x7FF
        elif kind == 3:
            base, polarity = value & 0x7FF, 2 * (value >> 11) - 1
        elif kind == 6 and sound != 0:
            if value >= top:
                low, before, top, mark = value, top, value, count
            else:
                low, top, before, undone = lower(value, next_low(words, at), top, before)
                if undone:
                    lost, count = lost + count - mark, mark
                mark = count
        elif kind == 8:
            clock = clocks[number]
            number += 1
            sound = 2 if clock == LOST else 1
            if clock != LOST and clock != high:
                high, top, before, mark = clock, UNKNOWN, UNKNOWN, count
        else:
            continue
        if kind == 6 or kind == 8:
            kept, now = sound == 1 and low >= 0, high << BITS | max(low, 0)
            missed = sound == 2 or (sound == 1 and low == LOST)
    if stop < len(words) and not final and stop > 0:
        value = np.int64(words[stop] & 0xFFF)
        if value < top and lower(value, next_low(words, stop), top, before)[3]:
            lost, count, top, low = lost + count - mark, mark, before, before
    advance(state, clocks[:number], NEAR)
    state[LOW], state[TOP], state[BEFORE], state[SOUND] = low, top, before, sound
    state[ROW], state[BASE], state[POLARITY] = row, base, polarity
    return x[:count], y[:count], t[:count], p[:count], stop, lost


@njit(cache=True, nogil=True)
def lower(value, following, top, before):
    """What a TIME LOW below the highest before it means: low, top and before, and whether the highest was the fault.

    Either this one is a fault, then the next is as high as before; or the highest was, then this one fits what came
    before that; or a TIME HIGH is missing, and all is lost until the next.
    """
    if following >= top:
        return np.int64(LOST), top, before, False
    if value >= before:
        return value, value, before, True
    return np.int64(LOST), np.int64(1 << BITS), np.int64(1 << BITS), False
