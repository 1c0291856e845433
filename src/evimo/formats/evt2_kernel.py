# pyright: basic
"""Prophesee's EVT 2.0, words of 32 bits, and EVT 2.1, words of 64 bits, compiled.

EVT 2.0: 4 bits kind, 6 bits of time in µs, 11 bits x, 11 bits y; of kind 8, 28 upper bits of the time. EVT 2.1 has the
same in one half of a word; the other half says which of the 32 pixels from x on saw an event. Kinds 0 and 1 are OFF
and ON; triggers, continuations and the rest carry no events.
"""

import numpy as np

from evimo.compiling import njit
from evimo.formats.evt_clock_kernel import (
    CLOCK,
    CLOCK_STATE,
    LOST,
    UNDECIDED,
    UNKNOWN,
    advance,
    believed_clocks,
    clock_words,
)

BITS, LOW_BITS = 28, 6
SHIFT, HIGH, PIXEL = np.uint32(28), np.uint32(8), np.uint16(0x7FF)
NEAR = 4096  # units of 64 µs
HASH = np.uint32(0x077CB531)  # whose upper five bits tell apart all products with powers of two (de Bruijn)
PLACES = np.zeros(32, np.int64)
PLACES[[(int(HASH) << place & 0xFFFFFFFF) >> 27 for place in range(32)]] = np.arange(32)
SOUND, STATE_SIZE = CLOCK_STATE, CLOCK_STATE + 1


@njit(nogil=True)
def evt2_state():
    """The state before the first word."""
    state = np.zeros(STATE_SIZE, np.int64)
    state[CLOCK] = UNKNOWN
    return state


@njit(nogil=True)
def decode_evt2(words, state, final):
    """Events of EVT 2.0 words (u4), how many words were used, and how many events are lost; as `decode_evt3`."""
    values, places = clock_words(words, SHIFT, HIGH)
    clocks = believed_clocks(values, state, BITS, NEAR, final)
    stop = _stop(len(words), clocks, places)
    x, y = np.empty(stop + 1, np.uint16), np.empty(stop + 1, np.uint16)
    t, p = np.empty(stop + 1, np.int64), np.empty(stop + 1, np.int8)
    sound, now, count, lost, at = state[SOUND], state[CLOCK] << LOW_BITS, 0, 0, 0
    for number in range(len(places) + 1):
        until = min(places[number], stop) if number < len(places) else stop
        first, some = count, words[at:until]
        if all_changes(some):
            count += len(some)
            spread(some, now, (x[first:count], y[first:count], t[first:count], p[first:count]))
        else:
            hole = hole_in(some)
            lost += len(some) - hole
            for word in some[:hole]:
                x[count], y[count] = word >> 11 & 0x7FF, word & 0x7FF
                t[count], p[count] = now | (word >> 22 & 0x3F), (word >> 27 & 2) - 1
                count += word >> 29 == 0
        if sound != 1:
            lost, count = lost + (count - first) * (sound == 2), first
        if until == stop:
            break
        sound = 2 if clocks[number] == LOST else 1
        now, at = clocks[number] << LOW_BITS, until + 1
    advance(state, clocks[:number], NEAR)
    state[SOUND] = sound
    return x[:count], y[:count], t[:count], p[:count], stop, lost


@njit(nogil=True)
def all_changes(words):
    """Whether all words are events, OFF or ON, and none is a hole's."""
    bits, zeros = np.uint32(0), np.uint32(0)
    for word in words:
        bits |= word
        zeros += np.uint32(word == 0)
    return bits >> np.uint32(29) == 0 and zeros < 2


@njit(nogil=True)
def hole_in(words):
    """Where words of zeros begin, two at least, as of a file that was copied in part; their number where none do.

    A pixel at the corner has no two events at once, and what follows a hole has lost its clock.
    """
    for at in range(1, len(words)):
        if words[at] | words[at - 1] == 0:
            return at - 1
    return len(words)


@njit(nogil=True)
def spread(words, now, columns):
    """Columns of words that are all events, many at a time."""
    x, y, t, p = columns
    for at in range(len(words)):
        word = words[at]
        x[at], y[at] = np.uint16(word >> np.uint32(11)) & PIXEL, np.uint16(word) & PIXEL
        t[at] = now | np.int64(word >> np.uint32(22) & np.uint32(0x3F))
        p[at] = (np.int8(word >> np.uint32(27)) & np.int8(2)) - np.int8(1)


@njit(nogil=True)
def _stop(count, clocks, places):
    """The place of the first TIME HIGH that must wait for what follows, `count` if there is none."""
    for at in range(len(clocks)):
        if clocks[at] == UNDECIDED:
            return places[at]
    return count


@njit(nogil=True)
def singled(heads, pixels, events):
    """Write one number for each pixel that saw an event, the head of its word and the pixel's place; their number."""
    count = np.uint64(0)
    for at in range(len(heads)):
        head, seen = np.int64(heads[at]), pixels[at]
        while seen != 0:
            lowest = np.uint32(seen & (~seen + np.uint32(1)))
            events[count] = PLACES[np.uint32(lowest * HASH) >> np.uint32(27)] << 32 | head
            count, seen = count + np.uint64(1), seen ^ lowest
    return np.int64(count)


@njit(nogil=True)
def spread_single(columns, now):
    """Columns of events, from those numbers in place of their times: many at a time."""
    x, y, t, p = columns
    for at in range(len(t)):
        event = t[at]
        x[at], y[at] = np.uint16(event >> 32) + (np.uint16(event >> 11) & PIXEL), np.uint16(event) & PIXEL
        p[at], t[at] = (np.int8(event >> 27) & np.int8(2)) - np.int8(1), now | (event >> 22 & 0x3F)


@njit(nogil=True)
def decode_evt21(halves, state, final, head):
    """Events of EVT 2.1 words, (N, 2) u4, half number `head` of which tells the kind; as `decode_evt2`."""
    heads, pixels = np.empty(len(halves), np.uint32), np.empty(len(halves), np.uint32)
    for at in range(len(halves)):
        heads[at], pixels[at] = halves[at, head], halves[at, 1 - head]
    values, places = clock_words(heads, SHIFT, HIGH)
    clocks = believed_clocks(values, state, BITS, NEAR, final)
    stop, most = _stop(len(heads), clocks, places), 0
    for at in range(stop):
        pixels[at] *= np.uint32(heads[at] >> np.uint32(29) == 0)
        most += _ones(pixels[at])
    x, y = np.empty(most, np.uint16), np.empty(most, np.uint16)
    t, p = np.empty(most, np.int64), np.empty(most, np.int8)
    sound, now, count, lost, at = state[SOUND], state[CLOCK] << LOW_BITS, 0, 0, 0
    for number in range(len(places) + 1):
        until = min(places[number], stop) if number < len(places) else stop
        last = count + singled(heads[at:until], pixels[at:until], t[count:])
        if sound == 1:
            spread_single((x[count:last], y[count:last], t[count:last], p[count:last]), now)
            count = last
        else:
            lost += (last - count) * (sound == 2)
        if until == stop:
            break
        sound = 2 if clocks[number] == LOST else 1
        now, at = clocks[number] << LOW_BITS, until + 1
    advance(state, clocks[:number], NEAR)
    state[SOUND] = sound
    return x[:count], y[:count], t[:count], p[:count], stop, lost


@njit(nogil=True)
def _ones(bits):
    """How many of 32 bits are set."""
    bits = np.int64(bits)
    bits -= bits >> 1 & 0x55555555
    bits = (bits & 0x33333333) + (bits >> 2 & 0x33333333)
    return (bits + (bits >> 4) & 0x0F0F0F0F) * 0x01010101 >> 24 & 0x3F
