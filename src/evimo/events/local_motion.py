# pyright: basic
"""Motion candidates by least squares (Lucas and Kanade, 1981) from counts of neighbouring slices.

One window and one baseline cannot serve all speeds (docs/decisions/0003-motion-evidence.md has the measurements): slow
motion shows over several slices, fast motion only after the slices have been warped by a first guess. Products of
spatial and temporal differences are what a small network cannot form by itself. Images are C-contiguous float32,
polarities or products first; outside an image is zero.
"""

from math import exp

import numba
import numpy as np
from numpy.typing import NDArray

from evimo.events.stack import BINS, SLICES

F4 = NDArray[np.float32]

CANDIDATES = 5
CANDIDATE_CHANNELS = 2 * CANDIDATES + 9 + 3
FASTEST_PX = 6.0  # of half the image per slice: first guesses beyond it are noise
_CELL = 2  # px of half the image per pixel of the candidates
PRODUCTS = 6  # xx, xy, yy, xt, yt, tt
XX, XY, YY, XT, YT, TT = range(PRODUCTS)


def gaussian(sigma_px: float) -> F4:
    """One-dimensional kernel (N,) that sums to 1."""
    reach = int(2.5 * sigma_px + 0.5)
    heights = np.array([exp(-0.5 * (step / sigma_px) ** 2) for step in range(-reach, reach + 1)])
    return (heights / heights.sum()).astype(np.float32)


def motion_candidates(voxels: F4) -> F4:
    """Local motion of the middle slice from a voxel grid (30, h, w) of `events.stack`, (22, h / 2, w / 2).

    Five candidates (x, y) in px of the grid per slice: small window; large window; long baseline, for slow motion;
    refined after warping by the large window's; refined after warping by a coarse image's, for fast motion. Then how
    much the unwarped and both warped images are to be trusted, 0...1: contrast, spread, what still changes. Last, trust
    by direction (xx, xy, yy).
    """
    slices = SLICES, BINS, 2
    counts = np.log1p(0.25 * np.expm1(voxels).reshape(*slices, *voxels.shape[1:]).sum(1))
    sharp = gaussian(0.7)
    first, before, here, after, last = (blurred(each, sharp) for each in counts)
    near = pooled_products(before, here, after, 2.0, _CELL)
    longer = near + pooled_products(first, before, here, 2.0, _CELL) + pooled_products(here, after, last, 2.0, _CELL)
    longer += pooled_products(first, here, last, 4.0, _CELL)
    small = blurred(near, sharp)
    at_large = local_motion(blurred(near, gaussian(8.0 / _CELL)))
    found = np.empty((CANDIDATE_CHANNELS, *near.shape[1:]), np.float32)
    found[0:2], found[2:4], found[4:6] = (
        local_motion(small),
        at_large,
        local_motion(blurred(longer, gaussian(5.0 / _CELL))),
    )
    trust(small, found[10:13])
    directional_trust(small, found[19:22])
    for number, guess in enumerate((at_large, _of_coarse(counts))):
        start = _bounded(guess)
        moved = warped(before, after, blurred(start, sharp), _CELL)
        left = blurred(pooled_products(moved[0], here, moved[1], 2.0, _CELL), gaussian(4.0 / _CELL))
        found[6 + 2 * number : 8 + 2 * number] = start + _bounded(local_motion(left))
        trust(left, found[13 + 3 * number : 16 + 3 * number])
    return found


def _of_coarse(counts: F4) -> F4:
    """Motion of the three middle slices' counts in cells twice as large, on the candidates' grid."""
    coarse = [blurred(_halved(np.expm1(each)), gaussian(0.7)) for each in counts[1:4]]
    motion = local_motion(blurred(pooled_products(coarse[0], coarse[1], coarse[2], 2.0, 1), gaussian(4.0)))
    return _CELL * motion


def _halved(counts: F4) -> F4:
    """log(1 + mean count) of cells of the candidates' grid."""
    channels, height, width = counts.shape
    cells = counts.reshape(channels, height // _CELL, _CELL, width // _CELL, _CELL)
    return np.log1p(cells.mean((2, 4)))


def _bounded(motion: F4) -> F4:
    return np.clip(motion, -FASTEST_PX, FASTEST_PX, dtype=np.float32)


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
    """Displacement (2, a, b) per slice that explains windowed products (6, a, b) best, px.

    A ridge pulls it towards 0 where there is little contrast, or along an edge: the aperture problem.
    """
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
