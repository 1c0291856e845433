# pyright: basic
"""Decoding of Event Stream 2 bodies, compiled."""

import numpy as np

from evimo.compiling import njit


@njit(nogil=True)
def decode_dvs(raw, t, height):
    """DVS events in raw bytes (Event Stream 2, type 1): one byte of time and polarity, two of x, two of y.

    A first byte of 0xFF adds 127 µs, 0xFE is a reset mark; else bit 0 is the polarity and the rest the time step.
    y counts from the bottom in the file, from the top here. Returns x, y, t, p, the bytes used, the time reached.
    """
    most = len(raw) // 5 + 1
    x, y = np.empty(most, np.uint16), np.empty(most, np.uint16)
    times, p = np.empty(most, np.int64), np.empty(most, np.int8)
    count, at = 0, 0
    while at < len(raw):
        first = raw[at]
        if first == 0xFF:
            t += 127
            at += 1
        elif first == 0xFE:
            at += 1
        elif at + 5 > len(raw):
            break
        else:
            t += first >> 1
            x[count] = raw[at + 1] | np.uint16(raw[at + 2]) << 8
            y[count] = height - 1 - (raw[at + 3] | np.uint16(raw[at + 4]) << 8)
            times[count] = t
            p[count] = 2 * (first & 1) - 1
            count += 1
            at += 5
    return x[:count], y[:count], times[:count], p[:count], at, t


@njit(nogil=True)
def decode_atis(raw, t, height):
    """ATIS events (type 2), change detections only; exposure measurements (bit 0) move the time and are left out.

    A first byte with its six high bits set adds 63 µs times its two low bits; else bit 1 is the polarity and the
    six high bits the time step. Returns as `decode_dvs`.
    """
    most = len(raw) // 5 + 1
    x, y = np.empty(most, np.uint16), np.empty(most, np.uint16)
    times, p = np.empty(most, np.int64), np.empty(most, np.int8)
    count, at = 0, 0
    while at < len(raw):
        first = raw[at]
        if first >= 0xFC:
            t += 63 * (first & 3)
            at += 1
        elif at + 5 > len(raw):
            break
        else:
            t += first >> 2
            if first & 1 == 0:
                x[count] = raw[at + 1] | np.uint16(raw[at + 2]) << 8
                y[count] = height - 1 - (raw[at + 3] | np.uint16(raw[at + 4]) << 8)
                times[count] = t
                p[count] = (first & 2) - 1
                count += 1
            at += 5
    return x[:count], y[:count], times[:count], p[:count], at, t
