# pyright: basic
"""Decoding of the encoding `libcaer_cmp` of event_camera_msgs, compiled. Times come out in µs, rounded from ns."""

import numpy as np

from evimo.compiling import njit

HIGH, LOW, COLUMN, ROW, BASE_ROW, ROWS = 0, 1, 2, 3, 4, 5


@njit(nogil=True)
def libcaer_cmp_count(words):
    """At most so many events are in the words."""
    count = 0
    for code in words:
        kind = code >> 12
        if kind == ROW:
            count += 1
        elif kind == ROWS:
            count += 8
    return count


@njit(nogil=True)
def decode_libcaer_cmp(words, base_ns):
    """Words of 16 bits, their kind in the upper four; a message stands for itself.

    Kinds: 0 and 1 the high and low 12 bits of the µs after the base, 2 the column, 3 row and polarity of one event, 4
    base row and polarity, 5 the events in eight rows from the base on.
    """
    most = libcaer_cmp_count(words)
    x, y = np.empty(most, np.uint16), np.empty(most, np.uint16)
    t, p = np.empty(most, np.int64), np.empty(most, np.int8)
    high = low = column = base = polarity = count = 0
    base_us = (base_ns + 500) // 1000
    for code in words:
        kind, value = np.int64(code >> 12), np.int64(code & 0xFFF)
        time_us = base_us + (high << 12 | low)
        if kind == HIGH:
            high = value
        elif kind == LOW:
            low = value
        elif kind == COLUMN:
            column = value & 0x7FF
        elif kind == ROW:
            x[count], y[count], t[count], p[count] = column, value & 0x7FF, time_us, 2 * (value >> 11) - 1
            count += 1
        elif kind == BASE_ROW:
            base, polarity = value & 0x7FF, 2 * (value >> 11) - 1
        elif kind == ROWS:
            for step in range(8):
                if value >> step & 1:
                    x[count], y[count], t[count], p[count] = column, base + step, time_us, polarity
                    count += 1
            base += 8
    return x[:count], y[:count], t[:count], p[:count]
