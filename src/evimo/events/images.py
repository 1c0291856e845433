# pyright: basic
"""Compiled passes over images of events: blurring, and warping by a displacement of each pixel.

Images are C-contiguous float32, polarities or whatever else first; outside an image is zero. Innermost loops go along
rows, without branches, so that the compiler makes them run on vectors; functions of one row are inlined, since calling
them takes longer than they do.
"""

from math import exp

import numpy as np

from evimo.compiling import njit

_jit = njit(nogil=True, fastmath=True, error_model="numpy")
_inlined = njit(nogil=True, fastmath=True, error_model="numpy", inline="always")
_0, _3, _QUARTER = np.float32(0), np.float32(3), np.float32(0.25)


def gaussian(sigma_px: float) -> tuple[np.float32, ...]:
    """The middle of a one-dimensional kernel that sums to 1, then one of its sides.

    A tuple: the compiler then knows its length, and writes the loop over it out.
    """
    reach = int(2.5 * sigma_px + 0.5)
    heights = [exp(-0.5 * (step / sigma_px) ** 2) for step in range(reach + 1)]
    return tuple(np.float32(height / (2 * sum(heights) - 1)) for height in heights)


@_jit
def blurred(planes, kernel):
    """Planes (C, h, w) blurred by a separable kernel, down and then across."""
    count, height, width = planes.shape
    reach = len(kernel) - 1
    result = np.empty_like(planes)
    source, down = np.zeros((height + 2 * reach, width), np.float32), np.zeros(width + 2 * reach, np.float32)
    for c in range(count):
        for y in range(height):
            for x in range(width):
                source[reach + y, x] = planes[c, y, x]
        for y in range(reach, reach + height):
            for x in range(width):
                total = kernel[0] * source[y, x]
                for k in range(1, len(kernel)):
                    total += kernel[k] * (source[y - k, x] + source[y + k, x])
                down[reach + x] = total
            target = result[c, y - reach]
            for x in range(width):
                total = kernel[0] * down[reach + x]
                for k in range(1, len(kernel)):
                    total += kernel[k] * (down[reach + x - k] + down[reach + x + k])
                target[x] = total
    return result


@_jit
def warped(before, after, guess):
    """Both neighbours (2, h, w) warped to the middle slice by a guess (2, h / 2, w / 2), px per slice, itself enlarged.

    They are read bilinearly.
    """
    height, width = before.shape[1:]
    past, future = _with_margin(before), _with_margin(after)
    warped_before, warped_after = np.empty_like(before), np.empty_like(after)
    shift = np.empty((2, width), np.float32)
    corner, share = np.empty(width, np.int32), np.empty((2, width), np.float32)
    for y in range(height):
        _enlarge_row(guess[0], y, shift[0])
        _enlarge_row(guess[1], y, shift[1])
        _find_corners(y, height, -shift, corner, share)
        _read_row(past, corner, share, warped_before[:, y])
        _find_corners(y, height, shift, corner, share)
        _read_row(future, corner, share, warped_after[:, y])
    return warped_before, warped_after


@_jit
def _with_margin(image):
    """An image (2, h, w) with zeros around it, one pixel before and two behind: what is read outside is zero."""
    channels, height, width = image.shape
    result = np.zeros((channels, height + 3, width + 3), np.float32)
    for c in range(channels):
        for y in range(height):
            for x in range(width):
                result[c, y + 1, x + 1] = image[c, y, x]
    return result


@_inlined
def _enlarge_row(cells, y, row):
    """Write row y of cells (a, b) enlarged to (2 a, 2 b), bilinearly; beyond the outermost centres they go on flat."""
    near = y // 2
    other = min(max(near - 1 + 2 * (y % 2), 0), len(cells) - 1)
    wide = cells.shape[1]
    level = np.empty(wide + 2, np.float32)
    for x in range(wide):
        level[x + 1] = _QUARTER * (_3 * cells[near, x] + cells[other, x])
    level[0], level[wide + 1] = level[1], level[wide]
    for x in range(wide):
        row[2 * x] = _QUARTER * (level[x] + _3 * level[x + 1])
        row[2 * x + 1] = _QUARTER * (_3 * level[x + 1] + level[x + 2])


@_inlined
def _find_corners(y, height, shift, corner, share):
    """Where in an image with margins each pixel of row y is read: its upper left neighbour, and how far beyond it."""
    width = len(corner)
    for x in range(width):
        at_x = min(max(np.float32(x + 1) + shift[0, x], _0), np.float32(width + 1))
        at_y = min(max(np.float32(y + 1) + shift[1, x], _0), np.float32(height + 1))
        left, top = np.int32(at_x), np.int32(at_y)
        corner[x] = top * np.int32(width + 3) + left
        share[0, x], share[1, x] = at_x - np.float32(left), at_y - np.float32(top)


@_inlined
def _read_row(image, corner, share, into):
    """Interpolate between the four neighbours of each place, for both polarities."""
    below = image.shape[2]
    positive, negative = image[0].reshape(-1), image[1].reshape(-1)
    for x in range(len(corner)):
        k, fx, fy = np.uint32(corner[x]), share[0, x], share[1, x]
        into[0, x] = _between(positive, k, below, fx, fy)
        into[1, x] = _between(negative, k, below, fx, fy)


@_inlined
def _between(image, k, below, fx, fy):
    upper = image[k] + fx * (image[k + 1] - image[k])
    lower = image[k + below] + fx * (image[k + below + 1] - image[k + below])
    return upper + fy * (lower - upper)
