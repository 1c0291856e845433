# pyright: basic
"""Motion candidates by least squares (Lucas and Kanade, 1981) from counts of neighbouring slices.

One window and one baseline cannot serve all speeds (docs/decisions/0003-motion-evidence.md has the measurements): slow
motion shows over several slices, fast motion only after the slices have been warped by a first guess. Products of
spatial and temporal differences are what a small network cannot form by itself. Images are C-contiguous float32,
polarities or products first; outside an image is zero.

Each step is one compiled pass. Its innermost loops go along rows, without branches, so that the compiler makes them run
on vectors; functions of one row are inlined, since calling them takes longer than they do.
"""

import numpy as np
from numpy.typing import NDArray

from evimo.compiling import njit
from evimo.events.images import blurred, gaussian, warped
from evimo.events.logarithms import exp, ln
from evimo.events.stack import BINS, SLICES

F4 = NDArray[np.float32]

CANDIDATES = 5
CANDIDATE_CHANNELS = 2 * CANDIDATES + 9 + 3
FASTEST_PX = 6.0  # of half the image per slice: first guesses beyond it are noise
_CELL = 2  # px of half the image per pixel of the candidates
PRODUCTS = 6  # xx, xy, yy, xt, yt, tt
XX, XY, YY, XT, YT, TT = range(PRODUCTS)

_jit = njit(nogil=True, fastmath=True, error_model="numpy")
_inlined = njit(nogil=True, fastmath=True, error_model="numpy", inline="always")
_1, _3, _HALF, _QUARTER = (np.float32(number) for number in (1, 3, 0.5, 0.25))
_SHARP, _WARPED, _LONG, _LARGE = (gaussian(sigma_px) for sigma_px in (0.7, 4 / _CELL, 5 / _CELL, 8 / _CELL))


def motion_candidates(voxels: F4) -> F4:
    """Local motion of the middle slice from a voxel grid (30, h, w) of `events.stack`, (22, h / 2, w / 2).

    Five candidates (x, y) in px of the grid per slice: small window; large window; long baseline, for slow motion;
    refined after warping by the large window's; refined after warping by a coarse image's, for fast motion. Then how
    much the unwarped and both warped images are to be trusted, 0...1: contrast, spread, what still changes. Last, trust
    by direction (xx, xy, yy).
    """
    fine, coarse = log_counts(voxels)
    first, before, here, after, last = (blurred(each, _SHARP) for each in fine)
    found = np.empty((CANDIDATE_CHANNELS, *coarse.shape[2:]), np.float32)
    near = _products(before, here, after)
    longer = near.copy()
    for row, slices in (((first, before, here), 2), ((here, after, last), 2), ((first, here, last), 4)):
        add_products(*row, slices, longer)
    small = blurred(near, _SHARP)
    at_large = local_motion(blurred(near, _LARGE))
    found[0:2], found[2:4], found[4:6] = local_motion(small), at_large, local_motion(blurred(longer, _LONG))
    trust(small, found[10:13])
    directional_trust(small, found[19:22])
    for number, guess in enumerate((at_large, _of_coarse(coarse))):
        start = _bounded(guess)
        moved_before, moved_after = warped(before, after, blurred(start, _SHARP))
        left = blurred(_products(moved_before, here, moved_after), _WARPED)
        found[6 + 2 * number : 8 + 2 * number] = start + _bounded(local_motion(left))
        trust(left, found[13 + 3 * number : 16 + 3 * number])
    return found


def _products(before: F4, here: F4, after: F4, cell: int = _CELL) -> F4:
    """Products (6, a, b) of the slopes of three slices in a row, in means of cells."""
    products = np.zeros((PRODUCTS, here.shape[1] // cell, here.shape[2] // cell), np.float32)
    add_products(before, here, after, 2, products)
    return products


def _of_coarse(counts: F4) -> F4:
    """Motion of the three middle slices' counts in cells twice as large, on the candidates' grid."""
    before, here, after = (blurred(each, _SHARP) for each in counts)
    return _CELL * local_motion(blurred(_products(before, here, after, cell=1), _LARGE))


def _bounded(motion: F4) -> F4:
    return np.clip(motion, -FASTEST_PX, FASTEST_PX, dtype=np.float32)


@_jit
def log_counts(voxels):
    """log(1 + count / 4) of each slice (5, 2, h, w), and of means of cells of its middle three (3, 2, h / 2, w / 2)."""
    height, width = voxels.shape[1:]
    fine = np.empty((SLICES, 2, height, width), np.float32)
    coarse = np.empty((SLICES - 2, 2, height // _CELL, width // _CELL), np.float32)
    counts = np.empty((_CELL, width), np.float32)
    for number in range(SLICES):
        for polarity in range(2):
            channel = 2 * BINS * number + polarity
            one, two, three = voxels[channel], voxels[channel + 2], voxels[channel + 4]
            for y in range(height):
                _add_bins_of_row(one[y], two[y], three[y], counts[y % _CELL], fine[number, polarity, y])
                if y % _CELL == _CELL - 1 and 0 < number < SLICES - 1:
                    _log_means_of_cells(counts, coarse[number - 1, polarity, y // _CELL])
    return fine, coarse


@_inlined
def _add_bins_of_row(one, two, three, counts, logs):
    for x in range(len(counts)):
        counts[x] = _QUARTER * (exp(one[x]) + exp(two[x]) + exp(three[x]) - _3)
        logs[x] = ln(_1 + counts[x])


@_inlined
def _log_means_of_cells(counts, logs):
    upper, lower = counts[0], counts[1]
    for x in range(len(logs)):
        logs[x] = ln(_1 + _QUARTER * (upper[2 * x] + upper[2 * x + 1] + lower[2 * x] + lower[2 * x + 1]))


@_jit
def add_products(before, here, after, slices, into):
    """Add products of the slopes of three images (2, h, w), over both polarities, in means of cells, to (6, a, b).

    `slices` is the time from `before` to `after`. A cell is one pixel, or 2x2.
    """
    channels, height, width = here.shape
    cell = height // into.shape[1]
    mean = np.zeros((3, width + 2), np.float32)  # of three rows of the images, with a margin of nothing
    sums = np.zeros((PRODUCTS, width), np.float32)
    per_slice = np.float32(1 / slices)
    for c in range(channels):
        _mean_of_row(before[c], here[c], after[c], -1, mean[2])
        _mean_of_row(before[c], here[c], after[c], 0, mean[0])
        for y in range(height):
            above, level, below = mean[(y + 2) % 3], mean[y % 3], mean[(y + 1) % 3]
            _mean_of_row(before[c], here[c], after[c], y + 1, below)
            first, last = before[c, y], after[c, y]
            for x in range(width):
                dx, dy = _HALF * (level[x + 2] - level[x]), _HALF * (below[x + 1] - above[x + 1])
                dt = per_slice * (last[x] - first[x])
                sums[XX, x] += dx * dx
                sums[XY, x] += dx * dy
                sums[YY, x] += dy * dy
                sums[XT, x] += dx * dt
                sums[YT, x] += dy * dt
                sums[TT, x] += dt * dt
            if y % cell == cell - 1:
                _add_cells(sums, cell, into[:, y // cell])
                sums[:] = 0


@_inlined
def _mean_of_row(before, here, after, y, mean):
    """Write the mean of three images in row y, the middle one counted twice, into the middle of a row of margins."""
    if y < 0 or y >= len(here):
        mean[:] = 0
        return
    first, middle, last = before[y], here[y], after[y]
    for x in range(len(middle)):
        mean[x + 1] = _QUARTER * (first[x] + last[x]) + _HALF * middle[x]


@_inlined
def _add_cells(sums, cell, into):
    for product in range(PRODUCTS):
        source, target = sums[product], into[product]
        if cell == 1:
            target += source
        else:
            for x in range(len(target)):
                target[x] += _QUARTER * (source[2 * x] + source[2 * x + 1])


@_jit
def local_motion(found):
    """Displacement (2, a, b) per slice that explains windowed products (6, a, b) best, px.

    A ridge pulls it towards 0 where there is little contrast, or along an edge: the aperture problem.
    """
    high, wide = found.shape[1:]
    motion = np.empty((2, high, wide), np.float32)
    floor = np.float32(0.05 * _mean_contrast(found) + 1e-6)
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


@_jit
def _mean_contrast(found):
    return (found[XX] + found[YY]).mean()


@_jit
def trust(found, into):
    """Contrast, spread, and what still changes, 0...1 each, of windowed products (6, a, b), into (3, a, b)."""
    mean = np.float32(_mean_contrast(found) + 1e-6)
    tenth, hundredth, four = np.float32(0.1), np.float32(0.01), np.float32(4)
    for y in range(found.shape[1]):
        for x in range(found.shape[2]):
            xx, xy, yy, tt = found[XX, y, x], found[XY, y, x], found[YY, y, x], found[TT, y, x]
            contrast = xx + yy
            into[0, y, x] = contrast / (contrast + mean)
            into[1, y, x] = four * (xx * yy - xy * xy) / (contrast + hundredth * mean) ** 2
            into[2, y, x] = tt / (tt + contrast + tenth * mean)


@_jit
def directional_trust(found, into):
    """How much each window tells of its motion in each direction (xx, xy, yy), into (3, a, b)."""
    floor = np.float32(0.3 * _mean_contrast(found) + 1e-6)
    for y in range(found.shape[1]):
        for x in range(found.shape[2]):
            scale = found[XX, y, x] + found[YY, y, x] + floor
            for product in range(3):
                into[product, y, x] = found[product, y, x] / scale
