# pyright: basic
"""Sums of each sensor pixel to rectified images, on a GPU: what `events.frames` does with a list of events.

An event goes to the four pixels around its place. Here each pixel of the image asks instead which sensor pixels give to
it, in the order in which the CPU gives: no atomic additions, and the same sums whenever it runs.
"""

from typing import Any, NamedTuple

import numpy as np

from evimo.events.frames import CHANNELS, PixelTable
from evimo.events.slices import SLICE_US
from evimo.scene.rays.on_device import THREADS, blocks, cuda
from evimo.simulate.cuda_pixels import MS, SliceSums

f32, u64 = np.float32, np.uint64
_0, _1, _PER_SLICE = f32(0), f32(1), f32(1 / SLICE_US)
_FIELD, _SIXTEEN, _TICKS = u64(0xFFFF), u64(16), u64(32)


class Splat(NamedTuple):
    """A `PixelTable` the other way round: pixel q of the image (flat) gets from entries first[q] to first[q + 1].

    source: of each entry, flat index of the sensor pixel. weight: its share.
    """

    first: Any
    source: Any
    weight: Any


def splat_through(table: PixelTable) -> Splat:
    """The table as arrays."""
    height, width = table.out_height, table.out_width
    inside = table.valid & (table.x >= -0.5) & (table.x < width - 0.5) & (table.y >= -0.5) & (table.y < height - 0.5)
    source = np.flatnonzero(inside)
    x, y = table.x[inside].clip(0, width - 1), table.y[inside].clip(0, height - 1)
    left, top = x.astype(np.int64), y.astype(np.int64)
    right, below = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    ax, ay = (x - left).astype(np.float32), (y - top).astype(np.float32)
    weight = np.stack(((_1 - ax) * (_1 - ay), ax * (_1 - ay), (_1 - ax) * ay, ax * ay), axis=1).ravel()
    target = np.stack((top * width + left, top * width + right, below * width + left, below * width + right), axis=1)
    order = np.argsort(target.ravel(), kind="stable")
    order = order[weight[order] > 0]
    first = np.searchsorted(target.ravel()[order], np.arange(height * width + 1))
    return Splat(first, np.repeat(source, 4)[order].astype(np.int32), weight[order])


@cuda.jit
def _make_frames(packed, splat, frames):
    q, k = cuda.grid(2)
    if q < frames.shape[2] and k < frames.shape[0]:
        positive, negative, time = _0, _0, _0
        for e in range(splat.first[q], splat.first[q + 1]):
            counter, weight = packed[k, splat.source[e]], splat.weight[e]
            positive += weight * f32((counter >> _SIXTEEN) & _FIELD)
            negative += weight * f32(counter & _FIELD)
            time += weight * f32(counter >> _TICKS)
        total = positive + negative
        frames[k, 0, q], frames[k, 1, q] = positive, negative
        frames[k, 2, q] = min(time * _PER_SLICE / total, _1) if total > _0 else _0


@cuda.jit
def _make_counts(counts, splat, images):
    q, k = cuda.grid(2)
    if q < images.shape[1] and k < images.shape[0]:
        total = _0
        for e in range(splat.first[q], splat.first[q + 1]):
            total += splat.weight[e] * f32(counts[k, splat.source[e]])
        images[k, q] = total


def frames_of(sums: SliceSums, splat: Splat, size: tuple[int, int]) -> Any:
    """Event frames (S, 3, h, w) float32 on the GPU, as `events.frames.event_frame` makes them of a list."""
    slices, number = sums.packed.shape[0], size[0] * size[1]
    frames = cuda.device_array((slices, CHANNELS, number), np.float32)
    _make_frames[(blocks(number), slices), (THREADS, 1)](sums.packed, splat, frames)
    return frames.reshape(slices, CHANNELS, *size)


def milliseconds_of(sums: SliceSums, splat: Splat, size: tuple[int, int]) -> Any:
    """Events of each millisecond of each slice, (S, 25, h, w) float32 on the GPU."""
    slices, number, each = sums.packed.shape[0], size[0] * size[1], SLICE_US // MS
    images = cuda.device_array((slices * each, number), np.float32)
    counts = sums.ms.reshape(slices * each, sums.ms.shape[2])
    _make_counts[(blocks(number), slices * each), (THREADS, 1)](counts, splat, images)
    return images.reshape(slices, each, *size)
