# pyright: basic
"""Decoding of the payloads of ROS event messages, compiled. Times come out in µs, rounded from ns.

They are read as arrays of records, whose numbers may begin at any byte.
"""

import numpy as np

from evimo.compiling import njit

# dvs_msgs/Event: packed in 13 bytes. CDR aligns each to four bytes, so that one begins every 16, and all but the first
# have x and y two bytes sooner; a record of CDR_EVENT begins with them.
EVENT = np.dtype([("x", "<u2"), ("y", "<u2"), ("seconds", "<u4"), ("nanoseconds", "<u4"), ("polarity", "u1")])
CDR_SOONER, CDR_STEP = 2, 16
CDR_EVENT = np.dtype([("x", "<u2"), ("y", "<u2"), ("", "u2"), *EVENT.descr[2:]])
MONO = np.dtype([("nanoseconds", "<u4"), ("x", "<u2"), ("y", "<u2")])
LIBCAER = np.dtype([("packed", "<u4"), ("us", "<u4")])
LIBCAER_ROUND, LIBCAER_HALF = 1 << 31, 1 << 30  # µs
HALF_US, US = np.uint64(500), np.uint64(1000)  # in ns


@njit(nogil=True)
def decode_dvs_msgs(records):
    """dvs_msgs/Event (N,), as EVENT or CDR_EVENT."""
    count = len(records)
    x, y = np.empty(count, np.uint16), np.empty(count, np.uint16)
    t, p = np.empty(count, np.int64), np.empty(count, np.int8)
    for at in range(count):
        event = records[at]
        x[at], y[at] = event.x, event.y
        t[at] = np.int64(event.seconds) * 1_000_000 + np.int64((event.nanoseconds + HALF_US) // US)
        p[at] = 1 if event.polarity else -1
    return x, y, t, p


@njit(nogil=True)
def decode_mono(records, base_ns):
    """Encoding `mono`, MONO (N,): times after the packet's base; the highest bit of y is the polarity."""
    count = len(records)
    x, y = np.empty(count, np.uint16), np.empty(count, np.uint16)
    t, p = np.empty(count, np.int64), np.empty(count, np.int8)
    base_us, rest = base_ns // 1000, np.uint64(base_ns % 1000 + 500)
    for at in range(count):
        event = records[at]
        x[at], y[at] = event.x, event.y & np.uint16(0x7FFF)
        t[at] = base_us + np.int64((event.nanoseconds + rest) // US)
        p[at] = np.int8(event.y >> np.uint16(14) & np.uint16(2)) - np.int8(1)
    return x, y, t, p


@njit(nogil=True)
def decode_libcaer(records, base_ns):
    """Encoding `libcaer`, LIBCAER (N,): bits 17-31 x, 2-16 y, 1 polarity; then µs after the base, of 31 bits.

    Each time is the one nearest to that before it, so that a damaged one costs no more than itself.
    """
    count = len(records)
    x, y = np.empty(count, np.uint16), np.empty(count, np.uint16)
    t, p = np.empty(count, np.int64), np.empty(count, np.int8)
    base_us = (base_ns + 500) // 1000
    reached = np.int64(records[0].us) & (LIBCAER_ROUND - 1) if count else 0
    for at in range(count):
        packed, low = records[at].packed, np.int64(records[at].us)
        reached += ((low - reached + LIBCAER_HALF) & (LIBCAER_ROUND - 1)) - LIBCAER_HALF
        x[at], y[at] = packed >> 17, packed >> 2 & 0x7FFF
        t[at] = base_us + reached
        p[at] = 1 if packed >> 1 & 1 else -1
    return x, y, t, p
