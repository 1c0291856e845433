# pyright: basic
"""Decoding of the payloads of ROS event messages, compiled. Times come out in µs, rounded from ns."""

import numpy as np
from numba import njit

# What EVT3 keeps from one message to the next.
TIME_HIGH, TIME_LOW, ROW, BASE_COLUMN, POLARITY, EXPECTED_US, STATE_SIZE = 0, 1, 2, 3, 4, 5, 6
UNKNOWN = -1
LIBCAER_WRAP_NS = (1 << 31) * 1000
SOONER_US = 1 << 20  # a message's first time is before its last, which is what is expected, or sooner by so much


@njit(cache=True, nogil=True)
def decode_dvs_msgs(raw, count, item):
    """dvs_msgs/Event: x u2, y u2, seconds u4, nanoseconds u4, polarity u1: 13 bytes packed.

    Where CDR aligns each to its size, one begins every 16, and all but the first have x and y two bytes sooner.
    """
    x, y = np.empty(count, np.uint16), np.empty(count, np.uint16)
    t, p = np.empty(count, np.int64), np.empty(count, np.int8)
    for i in range(count):
        at = item * i
        place = at - 2 if i > 0 and item == 16 else at
        x[i] = raw[place] | np.uint16(raw[place + 1]) << 8
        y[i] = raw[place + 2] | np.uint16(raw[place + 3]) << 8
        t[i] = word(raw, at + 4) * 1_000_000 + (word(raw, at + 8) + 500) // 1000
        p[i] = 1 if raw[at + 12] else -1
    return x, y, t, p


@njit(cache=True, nogil=True)
def word(raw, at):
    """Four bytes, little end first."""
    return np.int64(raw[at]) | np.int64(raw[at + 1]) << 8 | np.int64(raw[at + 2]) << 16 | np.int64(raw[at + 3]) << 24


@njit(cache=True, nogil=True)
def decode_mono(raw, base_ns):
    """Encoding `mono`: ns after the packet's base u4, x u2, then y in 15 bits and the polarity in the highest."""
    count = len(raw) // 8
    x, y = np.empty(count, np.uint16), np.empty(count, np.uint16)
    t, p = np.empty(count, np.int64), np.empty(count, np.int8)
    for i in range(count):
        at = 8 * i
        x[i] = raw[at + 4] | np.uint16(raw[at + 5]) << 8
        y[i] = raw[at + 6] | np.uint16(raw[at + 7] & 0x7F) << 8
        t[i] = (base_ns + word(raw, at) + 500) // 1000
        p[i] = 1 if raw[at + 7] & 0x80 else -1
    return x, y, t, p


@njit(cache=True, nogil=True)
def decode_libcaer(raw, base_ns):
    """Encoding `libcaer`: bits 17-31 x, 2-16 y, 1 polarity; then µs after the base, 31 bits that wrap in a packet."""
    count = len(raw) // 8
    x, y = np.empty(count, np.uint16), np.empty(count, np.uint16)
    t, p = np.empty(count, np.int64), np.empty(count, np.int8)
    before = 0
    for i in range(count):
        packed, low = word(raw, 8 * i), word(raw, 8 * i + 4)
        if low < before:
            base_ns += LIBCAER_WRAP_NS
        before = low
        x[i] = packed >> 17
        y[i] = packed >> 2 & 0x7FFF
        t[i] = (base_ns + low * 1000 + 500) // 1000
        p[i] = 1 if packed >> 1 & 1 else -1
    return x, y, t, p


@njit(cache=True, nogil=True)
def evt3_state(expected_us):
    """The state before the first word; the sensor's 24-bit clock is placed in the last round before expected_us."""
    state = np.zeros(STATE_SIZE, np.int64)
    state[TIME_HIGH] = state[TIME_LOW] = UNKNOWN
    state[EXPECTED_US] = expected_us
    return state


@njit(cache=True, nogil=True)
def evt3_count(words):
    """At most so many events are in the words."""
    count = 0
    for code in words:
        kind = code >> 12
        if kind == 2:
            count += 1
        elif kind == 4:
            count += 12
        elif kind == 5:
            count += 8
    return count


@njit(cache=True, nogil=True)
def high_time(before, high, expected_us):
    """The upper clock with its rounds (µs / 4096) after a TIME_HIGH of 12 bits."""
    if before == UNKNOWN:
        rounds = (expected_us + SOONER_US - (high << 12)) >> 24
        return max(rounds, 0) << 12 | high
    rounds = before >> 12
    if (before & 0xFFF) - high > 2048:  # a little backwards happens without a wrap
        rounds += 1
    return rounds << 12 | high


@njit(cache=True, nogil=True)
def decode_evt3(words, state):
    """Prophesee EVT 3.0 words (u2): events after the first whole time; `state` is carried on.

    Kinds: 0 row, 2 column and polarity, 3 base column and polarity, 4 and 5 vectors of 12 and 8 pixels from the
    base on, 6 and 8 the low and high 12 bits of the time; triggers and the rest carry no events.
    """
    most = evt3_count(words)
    x, y = np.empty(most, np.uint16), np.empty(most, np.uint16)
    t, p = np.empty(most, np.int64), np.empty(most, np.int8)
    high, low, row = state[TIME_HIGH], state[TIME_LOW], state[ROW]
    base, polarity, count = state[BASE_COLUMN], state[POLARITY], 0
    for code in words:
        kind, value = np.int64(code >> 12), np.int64(code & 0xFFF)
        if kind == 8:
            high = high_time(high, value, state[EXPECTED_US])
        elif kind == 6:
            low = value if high != UNKNOWN else UNKNOWN
        elif kind == 0:
            row = value & 0x7FF
        elif kind == 3:
            base, polarity = value & 0x7FF, 2 * (value >> 11) - 1
        elif kind == 2 and low != UNKNOWN:
            x[count], y[count], t[count] = value & 0x7FF, row, high << 12 | low
            p[count] = 2 * (value >> 11) - 1
            count += 1
        elif kind == 4 or kind == 5:
            for step in range(12 if kind == 4 else 8):
                if value >> step & 1 and low != UNKNOWN:
                    x[count], y[count], t[count], p[count] = base + step, row, high << 12 | low, polarity
                    count += 1
            base += 12 if kind == 4 else 8
    state[TIME_HIGH], state[TIME_LOW], state[ROW] = high, low, row
    state[BASE_COLUMN], state[POLARITY] = base, polarity
    return x[:count], y[:count], t[:count], p[:count]
