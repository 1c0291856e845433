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
SHIFT, HIGH = np.uint32(28), np.uint32(8)
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
        first = count
        for word in words[at:until]:
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
def _stop(count, clocks, places):
    """The place of the first TIME HIGH that must wait for what follows, `count` if there is none."""
    for at in range(len(clocks)):
        if clocks[at] == UNDECIDED:
            return places[at]
    return count


@njit(nogil=True)
def decode_evt21(halves, state, final, head):
    """Events of EVT 2.1 words, (N, 2) u4, half number `head` of which tells the kind; as `decode_evt2`."""
    heads, pixels = halves[:, head], halves[:, 1 - head]
    most = 1
    for at in range(len(heads)):
        most += _ones(pixels[at]) if heads[at] >> 29 == 0 else 0
    values, places = clock_words(heads, SHIFT, HIGH)
    clocks = believed_clocks(values, state, BITS, NEAR, final)
    stop = _stop(len(heads), clocks, places)
    x, y = np.empty(most, np.uint16), np.empty(most, np.uint16)
    t, p = np.empty(most, np.int64), np.empty(most, np.int8)
    sound, now, count, lost, number = state[SOUND], state[CLOCK] << LOW_BITS, 0, 0, 0
    for at in range(stop):
        word, seen = heads[at], pixels[at]
        if word >> 29 == 0 and sound == 1:
            column, row, polarity = word >> 11 & 0x7FF, word & 0x7FF, (word >> 27 & 2) - 1
            time = now | (word >> 22 & 0x3F)
            while seen != 0:
                lowest = np.uint32(seen & (~seen + np.uint32(1)))
                place = PLACES[np.uint32(lowest * HASH) >> np.uint32(27)]
                x[count], y[count], t[count], p[count] = column + place, row, time, polarity
                count += 1
                seen ^= lowest
        elif word >> 29 == 0:
            lost += _ones(seen) * (sound == 2)
        elif word >> 28 == 8:
            sound = 2 if clocks[number] == LOST else 1
            now, number = clocks[number] << LOW_BITS, number + 1
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
