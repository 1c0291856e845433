# pyright: basic
"""Compiled kernels of local motion: the same sums as `model/lucas_kanade.py`, one pass over the pixels each.

The graph of the networks would need some 600 small operators for them. Images are C-contiguous float32, polarities or
products first; outside an image is zero.
"""

from math import exp

import numba
import numpy as np
from numpy.typing import NDArray

F4 = NDArray[np.float32]

PRODUCTS = 6  # xx, xy, yy, xt, yt, tt
XX, XY, YY, XT, YT, TT = range(PRODUCTS)


def gaussian(sigma_px: float) -> F4:
    """One-dimensional kernel (N,) that sums to 1."""
    reach = int(2.5 * sigma_px + 0.5)
    heights = np.array([exp(-0.5 * (step / sigma_px) ** 2) for step in range(-reach, reach + 1)])
    return (heights / heights.sum()).astype(np.float32)


@numba.njit(cache=True, nogil=True, fastmath=True)
def halved(frame, reduction, into, cells):
    """An event frame (3, H, W) at half its size, and its counts again over cells of reduction x reduction of those.

    `into` (3, h, w): log(1 + count) of both polarities and the mean time about the slice's centre, means over 2 x 2
    pixels. `cells` (2, a, b): log(1 + count) of the mean count. Both may reach beyond the frame, where they are 0.
    """
    into[:] = 0
    cells[:] = 0
    one, half, quarter = np.float32(1), np.float32(0.5), np.float32(0.25)
    share = np.float32(1 / reduction**2)
    height, width = frame.shape[1:]
    for y in range((height + 1) // 2):
        positives, negatives, times = into[0, y], into[1, y], into[2, y]
        for row in range(2 * y, min(2 * y + 2, height)):
            positive, negative, time = frame[0, row], frame[1, row], frame[2, row]
            for x in range(width):
                at = x >> 1
                positives[at] += quarter * positive[x]
                negatives[at] += quarter * negative[x]
                times[at] += quarter * (time[x] - half * min(positive[x] + negative[x], one))
        for polarity in range(2):
            counts, coarse = into[polarity, y], cells[polarity, y // reduction]
            for x in range((width + 1) // 2):
                if counts[x] > 0:
                    coarse[x // reduction] += share * counts[x]
                    counts[x] = np.log1p(counts[x])
    for polarity in range(2):
        for y in range(cells.shape[1]):
            for x in range(cells.shape[2]):
                cells[polarity, y, x] = np.log1p(cells[polarity, y, x])


@numba.njit(cache=True, nogil=True, fastmath=True)
def blurred(planes, kernel):
    """Planes (C, h, w) blurred by a separable kernel."""
    count, height, width = planes.shape
    reach = len(kernel) // 2
    across, result = np.zeros((height, width), np.float32), np.zeros_like(planes)
    for c in range(count):
        across[:] = 0
        for y in range(height):
            source, target = planes[c, y], across[y]
            for k in range(-reach, reach + 1):
                share = kernel[k + reach]
                for x in range(max(0, -k), min(width, width - k)):
                    target[x] += share * source[x + k]
        for y in range(height):
            target = result[c, y]
            for k in range(max(-reach, -y), min(reach, height - 1 - y) + 1):
                share, source = kernel[k + reach], across[y + k]
                for x in range(width):
                    target[x] += share * source[x]
    return result


@numba.njit(cache=True, nogil=True, fastmath=True)
def pooled_products(before, here, after, slices, reduction):
    """Products (6, a, b) of the slopes of three images (2, h, w), over both polarities, in means of cells.

    `slices` is the time from `before` to `after`.
    """
    channels, height, width = here.shape
    high, wide = height // reduction, width // reduction
    result = np.zeros((PRODUCTS, high, wide), np.float32)
    mean = np.zeros((height + 2, width + 2), np.float32)
    sums = np.zeros((PRODUCTS, width), np.float32)
    half, quarter, per_slice = np.float32(0.5), np.float32(0.25), np.float32(1 / slices)
    share = np.float32(1 / reduction**2)
    for c in range(channels):
        for y in range(height):
            target, first, middle, last = mean[y + 1], before[c, y], here[c, y], after[c, y]
            for x in range(width):
                target[x + 1] = quarter * (first[x] + middle[x] + middle[x] + last[x])
        for cell in range(high):
            sums[:] = 0
            for y in range(cell * reduction, (cell + 1) * reduction):
                above, level, below, first, last = mean[y], mean[y + 1], mean[y + 2], before[c, y], after[c, y]
                for x in range(width):
                    dx, dy = half * (level[x + 2] - level[x]), half * (below[x + 1] - above[x + 1])
                    dt = per_slice * (last[x] - first[x])
                    sums[0, x] += dx * dx
                    sums[1, x] += dx * dy
                    sums[2, x] += dy * dy
                    sums[3, x] += dx * dt
                    sums[4, x] += dy * dt
                    sums[5, x] += dt * dt
            for product in range(PRODUCTS):
                for x in range(wide * reduction):
                    result[product, cell, x // reduction] += share * sums[product, x]
    return result


@numba.njit(cache=True, nogil=True, fastmath=True)
def local_motion(found):
    """Displacement (2, a, b) per slice that explains windowed products (6, a, b) best; see the torch one."""
    high, wide = found.shape[1:]
    motion = np.empty((2, high, wide), np.float32)
    floor = np.float32(0.05 * (found[XX] + found[YY]).mean() + 1e-6)
    share = np.float32(0.02)
    for y in range(high):
        for x in range(wide):
            ridge = floor + share * (found[XX, y, x] + found[YY, y, x])
            xx, yy, xy = found[XX, y, x] + ridge, found[YY, y, x] + ridge, found[XY, y, x]
            xt, yt = found[XT, y, x], found[YT, y, x]
            area = xx * yy - xy * xy
            motion[0, y, x] = (xy * yt - yy * xt) / area
            motion[1, y, x] = (xy * xt - xx * yt) / area
    return motion


@numba.njit(cache=True, nogil=True, fastmath=True)
def trust(found, into):
    """Contrast, spread, and what still changes, 0...1 each, of windowed products (6, a, b), into (3, a, b)."""
    mean = np.float32((found[XX] + found[YY]).mean() + 1e-6)
    tenth, hundredth, four = np.float32(0.1), np.float32(0.01), np.float32(4)
    for y in range(found.shape[1]):
        for x in range(found.shape[2]):
            xx, xy, yy, tt = found[XX, y, x], found[XY, y, x], found[YY, y, x], found[TT, y, x]
            contrast = xx + yy
            into[0, y, x] = contrast / (contrast + mean)
            into[1, y, x] = four * (xx * yy - xy * xy) / (contrast + hundredth * mean) ** 2
            into[2, y, x] = tt / (tt + contrast + tenth * mean)


@numba.njit(cache=True, nogil=True, fastmath=True)
def directional_trust(found, into):
    """How much each window tells of its motion in each direction (xx, xy, yy), into (3, a, b)."""
    floor = np.float32(0.3 * (found[XX] + found[YY]).mean() + 1e-6)
    for y in range(found.shape[1]):
        for x in range(found.shape[2]):
            scale = found[XX, y, x] + found[YY, y, x] + floor
            for product in range(3):
                into[product, y, x] = found[product, y, x] / scale


@numba.njit(cache=True, nogil=True, fastmath=True)
def _weights(cells, pixels, reduction):
    """For each pixel the two cells to interpolate between, and the share of the second."""
    first, second, share = np.empty(pixels, np.int64), np.empty(pixels, np.int64), np.empty(pixels, np.float32)
    for k in range(pixels):
        at = max(0.0, (k + 0.5) / reduction - 0.5)
        first[k] = min(int(at), cells - 1)
        second[k] = min(first[k] + 1, cells - 1)
        share[k] = np.float32(at - first[k])
    return first, second, share


@numba.njit(cache=True, nogil=True, fastmath=True)
def warped(before, after, guess, reduction):
    """Both neighbours (2, h, w) warped to the middle slice by a guess (2, a, b), px per slice, itself enlarged."""
    height, width = before.shape[1:]
    left, right, by_x = _weights(guess.shape[2], width, reduction)
    upper, lower, by_y = _weights(guess.shape[1], height, reduction)
    warped_before, warped_after = np.empty_like(before), np.empty_like(after)
    shift = np.empty((2, guess.shape[2]), np.float32)  # of one row of pixels, not enlarged in x yet
    for y in range(height):
        for component in range(2):
            for x in range(guess.shape[2]):
                top, bottom = guess[component, upper[y], x], guess[component, lower[y], x]
                shift[component, x] = top + by_y[y] * (bottom - top)
        for x in range(width):
            u = shift[0, left[x]] + by_x[x] * (shift[0, right[x]] - shift[0, left[x]])
            v = shift[1, left[x]] + by_x[x] * (shift[1, right[x]] - shift[1, left[x]])
            _read(before, np.float32(x) - u, np.float32(y) - v, warped_before, y, x)
            _read(after, np.float32(x) + u, np.float32(y) + v, warped_after, y, x)
    return warped_before, warped_after


@numba.njit(cache=True, nogil=True, fastmath=True)
def _read(image, at_x, at_y, into, y, x):
    """Read an image (2, h, w) at (at_x, at_y) px, bilinearly, into one pixel of another; outside is zero."""
    channels, height, width = image.shape
    left, top = int(np.floor(at_x)), int(np.floor(at_y))
    fx, fy = at_x - np.float32(left), at_y - np.float32(top)
    one = np.float32(1)
    if 0 <= left < width - 1 and 0 <= top < height - 1:
        for c in range(channels):
            upper = image[c, top, left] + fx * (image[c, top, left + 1] - image[c, top, left])
            lower = image[c, top + 1, left] + fx * (image[c, top + 1, left + 1] - image[c, top + 1, left])
            into[c, y, x] = upper + fy * (lower - upper)
        return
    for c in range(channels):
        total = np.float32(0)
        for row, wy in ((top, one - fy), (top + 1, fy)):
            for column, wx in ((left, one - fx), (left + 1, fx)):
                if 0 <= row < height and 0 <= column < width:
                    total += wy * wx * image[c, row, column]
        into[c, y, x] = total
