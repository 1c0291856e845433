# pyright: basic
"""Decoding of the payloads of ROS event messages, compiled. Times come out in µs, rounded from ns."""

import numpy as np

from evimo.compiling import njit

LIBCAER_ROUND, LIBCAER_HALF = 1 << 31, 1 << 30  # µs


@njit(nogil=True)
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


@njit(nogil=True)
def word(raw, at):
    """Four bytes, little end first."""
    return np.int64(raw[at]) | np.int64(raw[at + 1]) << 8 | np.int64(raw[at + 2]) << 16 | np.int64(raw[at + 3]) << 24


@njit(nogil=True)
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


@njit(nogil=True)
def decode_libcaer(raw, base_ns):
    """Encoding `libcaer`: bits 17-31 x, 2-16 y, 1 polarity; then µs after the base, 31 bits that wrap in a packet.

    Each time is the one nearest to that before it, so that a damaged one costs no more than itself.
    """
    count = len(raw) // 8
    x, y = np.empty(count, np.uint16), np.empty(count, np.uint16)
    t, p = np.empty(count, np.int64), np.empty(count, np.int8)
    reached = word(raw, 4) & (LIBCAER_ROUND - 1) if count else 0
    for i in range(count):
        packed, low = word(raw, 8 * i), word(raw, 8 * i + 4)
        reached += ((low - reached + LIBCAER_HALF) & (LIBCAER_ROUND - 1)) - LIBCAER_HALF
        x[i] = packed >> 17
        y[i] = packed >> 2 & 0x7FFF
        t[i] = (base_ns + reached * 1000 + 500) // 1000
        p[i] = 1 if packed >> 1 & 1 else -1
    return x, y, t, p
