# pyright: basic
"""Records of AEDAT 2.0, compiled: 32 bits of address and 32 bits of time in µs, big-endian.

A DAVIS's address: bit 31 is 0 for polarity events (row in bits 22 to 30, column in 12 to 21, ON in bit 11, bit 10 set
for signals from outside); else bits 10 and 11 are 3 for the IMU (which of its seven values in bits 28 to 30, the
value in 12 to 27), and otherwise it is a pixel of a frame. A DVS128's: row in bits 8 to 14, column in 1 to 7, OFF in
bit 0; above them, marks. Rows are counted from the bottom, columns from the right.

All times are continued over wraps: each is the one nearest to that before it whose low 32 bits are as stored.
"""

from typing import NamedTuple

import numpy as np

from evimo.compiling import njit
from evimo.formats.clock_rules import NO_TIME

RECORD_BYTES = 8
OTHER, IMU_KIND, OUTSIDE_SIGNAL = np.uint32(1 << 31), np.uint32(3 << 10), np.uint32(1 << 10)
AXIS_AT, AXIS, FIRST_GYROSCOPE, LAST_GYROSCOPE = np.uint32(28), np.uint32(7), np.uint32(4), np.uint32(6)


class Layout(NamedTuple):
    """Where an address has what, by bits: those that no event has, column, row, polarity, and which of it is ON."""

    none: np.uint32
    column_at: np.uint32
    columns: np.uint32
    row_at: np.uint32
    rows: np.uint32
    polarity_at: np.uint32
    on: np.uint32


DAVIS = Layout(*map(np.uint32, (1 << 31 | 1 << 10, 12, 0x3FF, 22, 0x1FF, 11, 1)))
DVS128 = Layout(*map(np.uint32, (0xFFFF8000, 1, 0x7F, 8, 0x7F, 0, 0)))


@njit(nogil=True, inline="always")
def big(stored):
    """A number of 32 bits whose bytes are stored the other way round."""
    one, two, byte = np.uint32(8), np.uint32(24), np.uint32(0xFF00)
    return np.uint32(stored >> two | stored >> one & byte | (stored & byte) << one | stored << two)


@njit(nogil=True)
def decode_aedat2(records, state, final, layout, size):
    """The polarity events of records (N, 2) u4; state[0] is the time reached, NO_TIME before the first.

    Pixels are turned round by the sensor's `size` (height, width), unless it is (0, 0); those beyond it come out as
    65535 or near it, outside every sensor. Returns as `decode_evt2`.
    """
    most = len(records)
    x, y = np.empty(most + 1, np.uint16), np.empty(most + 1, np.uint16)
    t, p = np.empty(most + 1, np.int64), np.empty(most + 1, np.int8)
    turned = size[0] > 0
    reached, count = started(records, state[0]), 0
    before = np.uint32(reached)
    for at in range(most):
        address, low = big(records[at, 0]), big(records[at, 1])
        reached, before = reached + np.int32(low - before), low
        column = np.int64(address >> layout.column_at & layout.columns)
        row = np.int64(address >> layout.row_at & layout.rows)
        x[count], y[count] = size[1] - 1 - column if turned else column, size[0] - 1 - row if turned else row
        t[count] = reached
        p[count] = 2 * np.int8((address >> layout.polarity_at & np.uint32(1)) == layout.on) - 1
        count += address & layout.none == 0
    state[0] = reached
    return x[:count], y[:count], t[:count], p[:count], most, 0


@njit(nogil=True)
def started(records, reached):
    """The time reached before the first record; where there was none before, its own, without sign."""
    return np.int64(big(records[0, 1])) if reached == NO_TIME and len(records) else reached


@njit(nogil=True)
def others(records, counts):
    """Add to `counts` how many records (N, 2) u4 of a DAVIS complete a sample of the gyroscope, and are of frames."""
    for at in range(len(records)):
        address = big(records[at, 0])
        other, imu = address & OTHER != 0, address & IMU_KIND == IMU_KIND
        counts[0] += other and imu and address >> AXIS_AT & AXIS == LAST_GYROSCOPE
        counts[1] += other and not imu


@njit(nogil=True)
def gyroscope_values(records, state):
    """Times (M,) in µs, axes (M,) 0 to 2 and values (M,) of the gyroscope, of a DAVIS's records (N, 2) u4."""
    most, count = len(records), 0
    t, axis, value = np.empty(most + 1, np.int64), np.empty(most + 1, np.int64), np.empty(most + 1, np.int64)
    reached = started(records, state[0])
    before = np.uint32(reached)
    for at in range(most):
        address, low = big(records[at, 0]), big(records[at, 1])
        reached, before = reached + np.int32(low - before), low
        number = address >> AXIS_AT & AXIS
        t[count], axis[count] = reached, np.int64(number) - np.int64(FIRST_GYROSCOPE)
        value[count] = np.int16(address >> np.uint32(12) & np.uint32(0xFFFF))
        imu = address & OTHER != 0 and address & IMU_KIND == IMU_KIND
        count += imu and FIRST_GYROSCOPE <= number <= LAST_GYROSCOPE
    state[0] = reached
    return t[:count], axis[:count], value[:count]
