"""Records of AEDAT 2.0: 32 bits of address and 32 bits of time in µs, big-endian.

A DAVIS's address: bit 31 is 0 for polarity events (row in bits 22 to 30, column in 12 to 21, ON in bit 11, bit 10 set
for signals from outside); else bits 10 and 11 are 3 for the IMU (which of its seven values in bits 28 to 30, the
value in 12 to 27), and otherwise it is a pixel of a frame. A DVS128's: row in bits 8 to 14, column in 1 to 7, OFF in
bit 0; above them, marks. Rows are counted from the bottom, columns from the right.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.events.events import Events
from evimo.formats.columns import signs

RECORD_BYTES = 8
OTHER, IMU, IMU_KIND = 1 << 31, 3 << 10, 3 << 10
OUTSIDE_SIGNAL = 1 << 10
FIRST_GYROSCOPE, LAST_GYROSCOPE = 4, 6
MARKS = ~0x7FFF


class Words(NamedTuple):
    """Records: addresses (N,) and times (N,) in µs, continued over wraps."""

    address: NDArray[np.int64]
    t: NDArray[np.int64]

    def imu(self) -> NDArray[np.bool_]:
        """Which are values of the IMU."""
        return (self.address & (OTHER | IMU_KIND)) == (OTHER | IMU)

    def gyroscope_samples(self) -> int:
        """How many samples of the gyroscope are complete: the last of their axes is there."""
        return int((self.imu() & ((self.address >> 28) & 7 == LAST_GYROSCOPE)).sum())

    def frame_samples(self) -> int:
        """How many are pixels of frames."""
        return int((self.address & OTHER != 0).sum() - self.imu().sum())


def words(raw: bytes, reached_us: int) -> Words:
    """Whole records; each time is the one nearest to that before it whose low 32 bits are as stored."""
    stored = np.frombuffer(raw, ">u4").reshape(-1, 2)
    low = stored[:, 1].astype(np.uint32)
    before = np.concatenate((np.array([reached_us & 0xFFFFFFFF], np.uint32), low[:-1]))
    steps = (low - before).view(np.int32).astype(np.int64)
    return Words(stored[:, 0].astype(np.int64), reached_us + np.cumsum(steps))


def davis_events(block: Words, size: tuple[int, int]) -> Events:
    """The polarity events of a DAVIS."""
    kept = (block.address & (OTHER | OUTSIDE_SIGNAL)) == 0
    address = block.address[kept]
    return _events((address >> 12) & 0x3FF, (address >> 22) & 0x1FF, block.t[kept], (address >> 11 & 1) == 1, size=size)


def dvs128_events(block: Words, size: tuple[int, int]) -> Events:
    """The polarity events of a DVS128."""
    kept = (block.address & MARKS) == 0
    address = block.address[kept]
    return _events((address >> 1) & 0x7F, (address >> 8) & 0x7F, block.t[kept], (address & 1) == 0, size=size)


def gyroscope_words(block: Words) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Times and addresses of the gyroscope's values."""
    number = (block.address >> 28) & 7
    kept = block.imu() & (number >= FIRST_GYROSCOPE) & (number <= LAST_GYROSCOPE)
    return block.t[kept], block.address[kept]


def _events(
    column: NDArray[np.int64],
    row: NDArray[np.int64],
    t: NDArray[np.int64],
    on: NDArray[np.bool_],
    *,
    size: tuple[int, int],
) -> Events:
    """Pixels turned round; those beyond the sensor become negative, thus 65535 or near it: outside every sensor."""
    height, width = size
    x, y = (width - 1 - column, height - 1 - row) if height else (column, row)
    return Events(x.astype(np.uint16), y.astype(np.uint16), t, signs(on))
