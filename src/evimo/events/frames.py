# pyright: basic
"""Slices to event frames: the one compiled pass over the events."""

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadInput
from evimo.events.events import Events
from evimo.events.slices import SLICE_US

F4 = NDArray[np.float32]

CHANNELS = 3
COUNT_LIMIT = 65_535  # events added before the packed counters are emptied: none of their fields can overflow
TIME_BITS = 15  # the same for the sum of times: 65535 x 32767 < 2^31; longer slices count time in coarser ticks
CHUNK = 4096  # pixels decoded, then cleared while the cache still holds them


class PixelTable(NamedTuple):
    """Where each pixel of the sensor lies in the output image; made once per camera.

    x, y:   column and row in the output image, (H, W) float32; integers are pixel centres.
    valid:  (H, W) bool; events of other pixels are dropped.
    out_height, out_width: size of the output image; events that lie more than half a pixel outside are dropped.
    """

    x: F4
    y: F4
    valid: NDArray[np.bool_]
    out_height: int
    out_width: int


def identity_table(height: int, width: int) -> PixelTable:
    """The output image is the sensor itself."""
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    return PixelTable(x, y, np.ones((height, width), np.bool_), height, width)


def event_frame(
    events: Events, table: PixelTable, *, start_us: int, dt_us: int = SLICE_US, out: F4 | None = None
) -> F4:
    """Events of one slice as an image (3, h, w): see `FrameMaker.frame`. For many slices make one `FrameMaker`."""
    return FrameMaker(table).frame(events, start_us=start_us, dt_us=dt_us, out=out)


class FrameMaker:
    """Turns slices into event frames through one table; reuses its memory, so one per thread.

    total, dropped: events seen, and those left out (invalid pixel, off the sensor, outside the image or the slice).

    Raises:
        BadInput: the table's arrays differ in shape, or an image side is not positive.
    """

    def __init__(self, table: PixelTable) -> None:
        if table.x.ndim != 2 or not table.x.shape == table.y.shape == table.valid.shape:
            raise BadInput("a pixel table's arrays differ in shape", fix="x, y and valid of one shape (H, W)")
        if min(table.out_height, table.out_width) < 1:
            raise BadInput("an output image without pixels", fix="a positive out_height and out_width")
        self.total = 0
        self.dropped = 0
        self._table = PixelTable(
            np.ascontiguousarray(table.x, np.float32),
            np.ascontiguousarray(table.y, np.float32),
            np.ascontiguousarray(table.valid, np.bool_),
            int(table.out_height),
            int(table.out_width),
        )
        identity = identity_table(*table.x.shape)
        self._is_identity = identity[3:] == self._table[3:] and all(
            np.array_equal(one, other) for one, other in zip(identity[:3], self._table[:3], strict=True)
        )
        self._packed = np.zeros(table.x.size, np.uint64)

    def frame(self, events: Events, *, start_us: int, dt_us: int = SLICE_US, out: F4 | None = None) -> F4:
        """One event frame (3, h, w) float32: positive count, negative count, mean time.

        Each event adds its weight to the four pixels around its place in the output image, bilinearly; over the border
        the weight goes to the border pixel, so that the counts of one frame sum to the events kept. At whole positions
        counts are exact. Time is that in the slice, 0 at its start and below 1 at its end, weighted alike; 0 where no
        event is. Slices longer than 32.8 ms count time in ticks of a 16384th of the slice or finer.

        Args:
            events: of the slice; others are dropped and counted.
            start_us: the slice's start.
            dt_us: the slice's length.
            out: where to write, overwritten whole; C-contiguous.
        """
        if dt_us <= 0:
            raise BadInput(f"a slice of {dt_us} us", fix="a positive length, such as 25000")
        shape = (CHANNELS, self._table.out_height, self._table.out_width)
        image = np.empty(shape, np.float32) if out is None else out
        if image.shape != shape or image.dtype != np.float32 or not image.flags.c_contiguous:
            raise BadInput(f"cannot write a frame into {image.dtype} {image.shape}", fix=f"a float32 array {shape}")
        shift = max(0, (dt_us - 1).bit_length() - TIME_BITS)
        in_place = self._is_identity and len(events) <= COUNT_LIMIT
        dropped = (_frame_in_place if in_place else _frame_through_table)(
            np.ascontiguousarray(events.x, np.uint16),
            np.ascontiguousarray(events.y, np.uint16),
            np.ascontiguousarray(events.t, np.int64),
            np.ascontiguousarray(events.p, np.int8),
            start_us,
            dt_us,
            shift,
            self._table,
            self._packed,
            image.reshape(CHANNELS, -1),
        )
        self.dropped += int(dropped)
        self.total += len(events)
        return image


# The kernels add each event to one packed counter per sensor pixel: sum of ticks in the upper 32 bits, positive and
# negative count in 16 bits each. That is one read and one write per event instead of three, all in exact integers; a
# splat, being linear, can follow per pixel instead of per event.


@numba.njit(cache=True, nogil=True)
def _pack(x, y, t, p, start_us, dt_us, shift, width, packed):
    """Add events to the packed counters. Returns how many lie off the sensor or outside the slice."""
    height, dropped = len(packed) // width, 0
    dt, ticks_from = np.uint64(dt_us), np.uint64(shift)
    for i in range(len(t)):
        elapsed = np.uint64(t[i] - start_us)  # before the start it wraps to a very large number
        if (y[i] < height) & (x[i] < width) & (elapsed < dt):
            one = np.uint64(65536 if p[i] > 0 else 1)
            packed[np.int64(y[i]) * width + np.int64(x[i])] += ((elapsed >> ticks_from) << np.uint64(32)) + one
        else:
            dropped += 1
    return dropped


@numba.njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _decode(halves, positives, negatives, times, per_slice):
    """Counts and mean time of a run of pixels from their counters, seen as int32 pairs (counts, sum of ticks)."""
    for k in range(len(positives)):
        counts = halves[2 * k]
        positive, negative = np.float32((counts >> 16) & 65535), np.float32(counts & 65535)
        positives[k], negatives[k] = positive, negative
        times[k] = np.float32(halves[2 * k + 1]) * per_slice / max(positive + negative, np.float32(1))


@numba.njit(cache=True, nogil=True)
def _frame_in_place(x, y, t, p, start_us, dt_us, shift, table, packed, planes):
    """The frame where the output image is the sensor itself: decode the counters, then clear them. Returns dropped."""
    dropped = _pack(x, y, t, p, start_us, dt_us, shift, table.out_width, packed)
    halves, per_slice = packed.view(np.int32), np.float32((1 << shift) / dt_us)
    for first in range(0, len(packed), CHUNK):
        last = min(first + CHUNK, len(packed))
        into = planes[0][first:last], planes[1][first:last], planes[2][first:last]  # not planes[:, …]: that has strides
        _decode(halves[2 * first : 2 * last], *into, per_slice)
        packed[first:last] = 0
    return dropped


@numba.njit(cache=True, nogil=True, fastmath=True)
def _frame_through_table(x, y, t, p, start_us, dt_us, shift, table, packed, planes):
    """The frame where each sensor pixel has a place of its own: splat its counts and time. Returns dropped."""
    planes[:] = 0
    dropped = 0
    for first in range(0, len(t), COUNT_LIMIT):
        part = slice(first, first + COUNT_LIMIT)
        dropped += _pack(x[part], y[part], t[part], p[part], start_us, dt_us, shift, table.x.shape[1], packed)
        dropped += _splat(table, packed, planes)
    _average(planes[0], planes[1], planes[2], np.float32((1 << shift) / dt_us))
    return dropped


@numba.njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _average(positives, negatives, times, per_slice):
    """Sums of ticks to mean times. Divides before it asks whether it may: a branch would keep it from using SIMD."""
    for k in range(len(times)):
        weight = positives[k] + negatives[k]
        mean = min(times[k] * per_slice / weight, np.float32(1))
        times[k] = mean if weight > 0 else np.float32(0)


@numba.njit(cache=True, nogil=True, fastmath=True)
def _splat(table, packed, planes):
    """Move the counters to the four pixels around their places, and clear them. Returns the events dropped."""
    height, width, dropped = table.out_height, table.out_width, 0
    at_x, at_y, valid = table.x.reshape(-1), table.y.reshape(-1), table.valid.reshape(-1)
    positives, negatives, times = planes[0], planes[1], planes[2]
    for pixel in range(len(packed)):
        counter = packed[pixel]
        if counter == 0:
            continue
        packed[pixel] = 0
        counts = np.int64(counter & np.uint64(0xFFFFFFFF))
        x, y = at_x[pixel], at_y[pixel]
        if not (valid[pixel] and -0.5 <= x < width - 0.5 and -0.5 <= y < height - 0.5):
            dropped += (counts >> 16) + (counts & 65535)
            continue
        x, y = min(max(x, np.float32(0)), np.float32(width - 1)), min(max(y, np.float32(0)), np.float32(height - 1))
        left, top = int(x), int(y)
        right, below = min(left + 1, width - 1), min(top + 1, height - 1)
        ax, ay, one = x - np.float32(left), y - np.float32(top), np.float32(1)
        positive, negative = np.float32(counts >> 16), np.float32(counts & 65535)
        time = np.float32(np.int64(counter >> np.uint64(32)))
        if ax == 0 and ay == 0:
            at = top * width + left
            positives[at] += positive
            negatives[at] += negative
            times[at] += time
            continue
        for at, weight in (
            (top * width + left, (one - ax) * (one - ay)),
            (top * width + right, ax * (one - ay)),
            (below * width + left, (one - ax) * ay),
            (below * width + right, ax * ay),
        ):
            positives[at] += weight * positive
            negatives[at] += weight * negative
            times[at] += weight * time
    return dropped
