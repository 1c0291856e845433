# pyright: basic
"""Prophesee's EVT 3.0, words of 16 bits, compiled: the same for RAW files and for messages of ROS.

The upper 4 bits are the kind of a word: 0 row, 2 column and polarity, 3 base column and polarity, 4 and 5 vectors of
12 and 8 pixels from the base on, 6 and 8 the lower and the upper 12 bits of the time in µs; triggers, continuations
and the rest carry no events.
"""

import numpy as np

from evimo.compiling import njit
from evimo.formats.evt3_steady_kernel import (
    LARGEST_BASE,
    LOWEST_BIT,
    TOGETHER,
    at_first,
    at_last,
    gathered,
    gathered_vectors,
    ones,
    spread,
    with_vectors,
)
from evimo.formats.evt_clock_kernel import (
    CLOCK,
    CLOCK_STATE,
    EXPECTED,
    LOST,
    UNDECIDED,
    UNKNOWN,
    advance,
    believed_clocks,
    clock_words,
)

BITS = 12
SHIFT, ONE, SINGLE, VECTOR, HIGH, TIME_LOW, BITS_OF = (np.uint16(number) for number in (12, 1, 2, 2, 8, 6, 0xFFF))
NEAR = 64  # units of 4.096 ms
SOONER_US = 1 << 20  # the first time is before `expected_us`, or later by less than this

NONE_YET, GOOD, BAD = 0, 1, 2  # what the last TIME HIGH was

# What EVT 3 keeps from one block of words to the next, after what its clock keeps: the lower bits of the time, their
# highest value since the last TIME HIGH and the one before that, what that was, and where pixels and polarity are.
LOW, TOP, BEFORE, SOUND, ROW, BASE, POLARITY, STATE_SIZE = (CLOCK_STATE + at for at in range(8))
# Of one block: events that are kept and lost, how many were kept when the lower bits last changed, how many TIME HIGH
# words there were, the upper bits of the time, and whether there are vectors anywhere.
COUNT, GONE, MARK, NUMBER, UPPER, VECTORS, TALLY_SIZE = range(7)


@njit(nogil=True)
def evt3_state(expected_us):
    """The state before the first word; the sensor's 24-bit clock is placed in the last round before expected_us."""
    state = np.zeros(STATE_SIZE, np.int64)
    state[CLOCK] = state[LOW] = state[TOP] = state[BEFORE] = UNKNOWN
    state[EXPECTED], state[POLARITY] = (expected_us + SOONER_US) >> BITS, -1
    return state


@njit(nogil=True)
def most_events(words):
    """How many events there are at most, counted in numbers as short as the words: many at a time."""
    most = 0
    for first in range(0, len(words), 4096):
        some = words[first : first + 4096]
        single, vectors = np.uint16(0), np.uint16(0)
        for at in range(len(some)):
            kind = some[at] >> SHIFT
            single += np.uint16(kind == SINGLE)
            vectors += np.uint16(kind >> ONE == VECTOR)
        most += np.int64(single) + 12 * np.int64(vectors)
    return most


@njit(nogil=True)
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


@njit(nogil=True)
def next_low(words, at):
    """The next TIME LOW after number `at`, UNKNOWN if a TIME HIGH or the end comes first."""
    for other in range(at + 1, len(words)):
        if words[other] >> 12 == 6:
            return np.int64(words[other] & 0xFFF)
        if words[other] >> 12 == 8:
            return np.int64(UNKNOWN)
    return np.int64(UNKNOWN)


@njit(nogil=True)
def decode_evt3(words, state, final):
    """Events of EVT 3 words (u2) after the first whole time, how many words were used, and how many events are lost.

    The words that were not used must be given again, before those that follow; where none follow, `final` says so.
    Within one TIME HIGH the lower bits only grow: those followed by lower ones, or lower than those before, are lost.
    """
    vectors = with_vectors(words)
    most = most_events(words) if vectors else len(words)
    values, places = clock_words(words, SHIFT, HIGH)
    clocks = believed_clocks(values, state, BITS, NEAR, final)
    stop = len(words) if final else settled(words, clocks, places)
    x, y = np.empty(most + 1, np.uint16), np.empty(most + 1, np.uint16)
    t, p = np.empty(most + 1, np.int64), np.empty(most + 1, np.int8)
    tally = np.zeros(TALLY_SIZE, np.int64)
    tally[UPPER], tally[VECTORS] = state[CLOCK] << BITS, vectors
    decode_stretches(words, stop, (clocks, places), state, tally, (x, y, t, p))
    if 0 < stop < len(words) and not final and words[stop] & 0xFFF < state[TOP]:
        low = lower(np.int64(words[stop] & 0xFFF), next_low(words, stop), state[TOP], state[BEFORE])
        if low[3]:
            undo(tally)
            state[TOP] = state[LOW] = state[BEFORE]
    advance(state, clocks[: np.searchsorted(places, stop)], NEAR)
    count = tally[COUNT]
    return x[:count], y[:count], t[:count], p[:count], stop, tally[GONE]


@njit(nogil=True)
def undo(tally):
    """Lose the events since the lower bits last changed."""
    tally[GONE] += tally[COUNT] - tally[MARK]
    tally[COUNT] = tally[MARK]


@njit(nogil=True)
def decode_stretches(words, stop, high_words, state, tally, columns):
    """The events of the words before number `stop`: those of usual stretches at once, others word by word."""
    clocks, places = high_words
    at = np.int64(0)
    while at < stop:
        until = usual_until(min(at + TOGETHER, stop), clocks, places, tally)
        usual = until > at and is_usual(state)
        if not usual:
            until = after_low(words, at, min(stop, at + TOGETHER))
        if usual and decode_usual(words[at:until], state, tally, columns):
            while tally[NUMBER] < len(places) and places[tally[NUMBER]] < until:
                tally[NUMBER] += 1
        else:
            decode_words(words, at, until, clocks, state, tally, columns)
        at = until


@njit(nogil=True)
def is_usual(state):
    """Whether events are kept, and the lower bits of their time are the highest so far."""
    return state[SOUND] == GOOD and 0 <= state[LOW] == state[TOP] and state[BASE] <= LARGEST_BASE


@njit(nogil=True)
def usual_until(stop, clocks, places, tally):
    """The place of the next TIME HIGH that changes the upper bits of the time: most repeat them."""
    number, clock = tally[NUMBER], tally[UPPER] >> BITS
    while number < len(clocks) and places[number] < stop and clocks[number] == clock:
        number += 1
    return min(places[number], stop) if number < len(clocks) else stop


@njit(nogil=True)
def after_low(words, at, stop):
    """The place after the next TIME LOW."""
    while at < stop and words[at] >> SHIFT != TIME_LOW:
        at += 1
    return min(at + 1, stop)


@njit(nogil=True)
def decode_usual(words, state, tally, columns):
    """The events of words that are as usual, all at once; False, and nothing is changed, where they prove not to be."""
    known = at_first(state[LOW], state[BASE], state[POLARITY], state[ROW])
    x, y, t, p = columns
    first = tally[COUNT]
    if tally[VECTORS] and with_vectors(words):
        count, known, back = gathered_vectors(words, known, t[first:])
    else:
        count, known, back = gathered(words, known, t[first:])
    if back < 0:
        return False
    last = first + count
    spread((x[first:last], y[first:last], t[first:last], p[first:last]), tally[UPPER])
    tally[COUNT] = last
    keep_lows(words, state, tally)
    state[BASE], state[POLARITY], state[ROW] = at_last(known)
    return True


@njit(nogil=True)
def keep_lows(words, state, tally):
    """Keep the last TIME LOW, the one before it, and how many events were kept when it came."""
    since, last, at = 0, np.int64(UNKNOWN), len(words)
    while at > 0:
        at -= 1
        kind, value = words[at] >> SHIFT, np.int64(words[at] & BITS_OF)
        if kind == TIME_LOW and last == UNKNOWN:
            last, tally[MARK] = value, tally[COUNT] - since
        elif kind == TIME_LOW:
            state[LOW], state[TOP], state[BEFORE] = last, last, value
            return
        elif kind == SINGLE:
            since += 1
        elif kind >> ONE == VECTOR:
            since += ones(value)
    if last != UNKNOWN:
        state[BEFORE], state[LOW], state[TOP] = state[TOP], last, last


@njit(nogil=True)
def decode_words(words, start, stop, clocks, state, tally, columns):
    """The events of the words from `start` to before `stop`; those after it are looked at where times go back."""
    x, y, t, p = columns
    low, top, before, sound = state[LOW], state[TOP], state[BEFORE], state[SOUND]
    row, base, polarity = state[ROW], state[BASE], state[POLARITY]
    count, gone, mark, number, high = tally[COUNT], tally[GONE], tally[MARK], tally[NUMBER], tally[UPPER]
    kept, missed, now = standing(sound, high, low)
    for place in range(start, stop):
        kind, value = np.int64(words[place] >> 12), np.int64(words[place] & 0xFFF)
        if kind == 2:
            x[count], y[count], t[count], p[count] = value & 0x7FF, row, now, 2 * (value >> 11) - 1
            count, gone = count + kept, gone + missed
        elif kind == 0:
            row = value & 0x7FF
        elif kind == 4 or kind == 5:
            while value != 0:
                x[count], y[count], t[count], p[count] = base + LOWEST_BIT[value], row, now, polarity
                count, gone, value = count + kept, gone + missed, value & (value - 1)
            base += 12 if kind == 4 else 8
        elif kind == 6:
            if value >= top:
                low, before, top = value, top, value
            else:
                low, top, before, undone = lower(value, next_low(words, place), top, before)
                count, gone = (mark, gone + count - mark) if undone else (count, gone)
            mark = count
            kept, missed, now = standing(sound, high, low)
        elif kind == 8:
            clock, number = clocks[number], number + 1
            low = after_high(sound, low)
            if sound == NONE_YET or (clock != LOST and clock << BITS != high):
                high, top, before, mark = clock << BITS, UNKNOWN, UNKNOWN, count
            sound = BAD if clock == LOST else GOOD
            kept, missed, now = standing(sound, high, low)
        elif kind == 3:
            base, polarity = value & 0x7FF, 2 * (value >> 11) - 1
    state[LOW], state[TOP], state[BEFORE], state[SOUND] = low, top, before, sound
    state[ROW], state[BASE], state[POLARITY] = row, base, polarity
    tally[COUNT], tally[GONE], tally[MARK], tally[NUMBER], tally[UPPER] = count, gone, mark, number, high


@njit(nogil=True)
def after_high(sound, low):
    """The lower bits after a TIME HIGH: those before the first one may belong to any."""
    return np.int64(UNKNOWN) if sound == NONE_YET else low


@njit(nogil=True)
def standing(sound, high, low):
    """Whether events are kept, whether those that are not are lost, and their time."""
    kept = np.int64(sound == GOOD and low >= 0)
    missed = np.int64(sound == BAD or (sound == GOOD and low == LOST))
    return kept, missed, high | max(low, 0)


@njit(nogil=True)
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
