# pyright: basic
"""The events of a few slices about a middle one, and what networks see of them: voxel grids and local plane fits.

Everything here is one compiled pass over the events or over the image.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.compiling import njit
from evimo.events.logarithms import ln

F4 = NDArray[np.float32]

SLICES, BINS = 5, 3  # of a stack; of time within a slice
VOXELS = SLICES * BINS * 2
WINDOWS = 2  # time windows of plane fits: the middle slice alone, and the whole stack
FIT_FEATURES = 6
FITS = WINDOWS * 2 * FIT_FEATURES
CELL = 2  # px per cell of plane fits
REACH = 3  # cells to each side of a fit's window
FEWEST = 4  # events that a plane is fitted to
_MOMENTS = 10


class EventStack(NamedTuple):
    """Events of five slices at their places in the rectified image.

    x, y:     (N,) float32, px. t: (N,) float32, slices since the centre of the middle one, -2.5 <= t < 2.5.
    positive: (N,) bool.
    """

    x: F4
    y: F4
    t: F4
    positive: NDArray[np.bool_]


class StaticMotion(NamedTuple):
    """How the static world seems to move: what `compensated` takes away.

    twist:      (5, 6) float32, the camera's in each slice, mean depths and rad per slice.
    inv_depth:  (h, w) float32 at the centre of the middle slice, per mean depth; `step` px of the image per pixel.
    intrinsics: (4,) float32 fx fy cx cy of the rectified image, px.
    """

    twist: F4
    inv_depth: F4
    step: int
    intrinsics: F4


def compensated(stack: EventStack, motion: StaticMotion) -> EventStack:
    """The events where they would be at the centre of the middle slice if everything stood still but the camera.

    Each is moved by the motion field (paper, eq. 1; definition: `geometry.motion_field`) of the twist, summed from the
    centre to the event's own time, and of the depth where it arrives.
    """
    x, y = np.empty_like(stack.x), np.empty_like(stack.y)
    _compensate(stack, _summed(motion.twist), motion, x, y)
    return stack._replace(x=x, y=y)


def voxel_grid(stack: EventStack, size: tuple[int, int], *, step: int = 1, out: F4 | None = None) -> F4:
    """log(1 + count) of the events in three bins of time per slice and two polarities, (30, h, w).

    Channels: slice by slice, bin by bin, positive then negative. Each event is shared between the four pixels around
    it, bilinearly; what is outside is left out.

    Args:
        stack: events.
        size: (height, width) of the grid.
        step: px of the rectified image per pixel of the grid.
        out: where to write, overwritten whole.
    """
    grid = np.empty((VOXELS, *size), np.float32) if out is None else out
    grid[:] = 0
    _splat(stack, np.float32(1 / step), grid)
    _log(grid.reshape(-1))
    return grid


def plane_fits(stack: EventStack, size: tuple[int, int]) -> F4:
    """Planes t(x, y) fitted to the events around each cell of 2x2 px (Benosman et al., 2014), (24, h, w).

    For the middle slice, then for the whole stack, and there for positive, then negative events: normal velocity (x, y)
    in px per slice, bounded by u / (1 + |u| / 3) and weighted by what the plane explains; slope (x, y) in standard
    deviations of time; the share of the variance of time that the plane explains; log of the number of events. What a
    right compensation made sharp has no slope; what moves by itself keeps its own. 0 where fewer than four events are.

    Args:
        stack: events.
        size: (height, width) of the result, cells.
    """
    height, width = size
    moments = np.zeros((2 * WINDOWS, height + 2 * REACH, width + 2 * REACH, _MOMENTS), np.float32)
    fits = np.empty((2 * WINDOWS, FIT_FEATURES, *size), np.float32)
    _gather(stack, moments[:, REACH:-REACH, REACH:-REACH])
    _fit(moments, fits)
    return fits.reshape(-1, *size)


def _summed(twist: F4) -> F4:
    """(5, 6), the twist summed from the centre of the middle slice to the start of each."""
    before = np.concatenate((np.zeros((1, 6), np.float32), np.cumsum(twist, axis=0, dtype=np.float32)))[:-1]
    return before - before[SLICES // 2] - twist[SLICES // 2] / 2


@njit(nogil=True, fastmath=True)
def _compensate(stack, summed, motion, out_x, out_y):
    fx, fy, cx, cy = motion.intrinsics
    inv_depth, half = motion.inv_depth, np.float32(0.5)
    per_cell = np.float32(1 / motion.step)
    height, width = inv_depth.shape
    for e in range(len(stack.t)):
        since = stack.t[e] + np.float32(SLICES / 2)
        n = min(max(int(since), 0), SLICES - 1)
        part, own = since - np.float32(n), motion.twist[n]
        vx, vy, vz = summed[n, 0] + part * own[0], summed[n, 1] + part * own[1], summed[n, 2] + part * own[2]
        wx, wy, wz = summed[n, 3] + part * own[3], summed[n, 4] + part * own[4], summed[n, 5] + part * own[5]
        start_x, start_y = (stack.x[e] - cx) / fx, (stack.y[e] - cy) / fy
        x, y, at_x, at_y = start_x, start_y, stack.x[e], stack.y[e]
        for _ in range(2):  # the second time at the middle of the way, with the depth at its end
            row, column = int((at_y + half) * per_cell), int((at_x + half) * per_cell)
            inv_z = inv_depth[min(max(row, 0), height - 1), min(max(column, 0), width - 1)]
            u = inv_z * (x * vz - vx) + x * y * wx - (1 + x * x) * wy + y * wz
            v = inv_z * (y * vz - vy) + (1 + y * y) * wx - x * y * wy - x * wz
            at_x, at_y = stack.x[e] - u * fx, stack.y[e] - v * fy
            x, y = start_x - half * u, start_y - half * v
        out_x[e], out_y[e] = at_x, at_y


@njit(nogil=True, fastmath=True)
def _splat(stack, scale, grid):
    height, width = grid.shape[1:]
    half, one = np.float32(0.5), np.float32(1)
    for e in range(len(stack.t)):
        x, y = (stack.x[e] + half) * scale - half, (stack.y[e] + half) * scale - half
        if not (-half <= x < width - half and -half <= y < height - half):
            continue
        x, y = min(max(x, np.float32(0)), np.float32(width - 1)), min(max(y, np.float32(0)), np.float32(height - 1))
        bin_ = min(max(int((stack.t[e] + np.float32(SLICES / 2)) * BINS), 0), SLICES * BINS - 1)
        c = 2 * bin_ + (0 if stack.positive[e] else 1)
        left, top = int(x), int(y)
        right, below = min(left + 1, width - 1), min(top + 1, height - 1)
        ax, ay = x - np.float32(left), y - np.float32(top)
        grid[c, top, left] += (one - ax) * (one - ay)
        grid[c, top, right] += ax * (one - ay)
        grid[c, below, left] += (one - ax) * ay
        grid[c, below, right] += ax * ay


@njit(nogil=True, fastmath=True, error_model="numpy")
def _log(counts):
    """log(1 + count) in place."""
    for k in range(len(counts)):
        counts[k] = ln(np.float32(1) + counts[k])


@njit(nogil=True, fastmath=True)
def _gather(stack, moments):
    """Per cell: 1, t, tt, x, y, xx, xy, yy, xt, yt summed over its events, x and y about the image's middle."""
    height, width = moments.shape[1:3]
    half = np.float32(0.5)
    middle_x, middle_y = np.float32(CELL * width / 2), np.float32(CELL * height / 2)
    for e in range(len(stack.t)):
        x, y, t = stack.x[e], stack.y[e], stack.t[e]
        if not (-half <= x and -half <= y):
            continue
        column, row = int((x + half) / CELL), int((y + half) / CELL)
        if row >= height or column >= width:
            continue
        x, y = x - middle_x, y - middle_y
        polarity = 0 if stack.positive[e] else 1
        for window in range(WINDOWS):
            if window == 0 and abs(t) > half:
                continue
            sums = moments[2 * window + polarity, row, column]
            sums[0] += 1
            sums[1] += t
            sums[2] += t * t
            sums[3] += x
            sums[4] += y
            sums[5] += x * x
            sums[6] += x * y
            sums[7] += y * y
            sums[8] += x * t
            sums[9] += y * t


@njit(nogil=True, fastmath=True, error_model="numpy")
def _fit(moments, fits):
    """Moments of windows from those of cells with a margin, rows first, then columns; then a plane in each window."""
    groups, _, height, width = fits.shape
    window = 2 * REACH + 1
    high = np.empty((width + 2 * REACH) * _MOMENTS, np.float32)
    wide, planes = np.empty(width * _MOMENTS, np.float32), np.empty(FIT_FEATURES * width, np.float32)
    for group in range(groups):
        for row in range(height):
            cells = moments[group, row : row + window].reshape(window, -1)
            for k in range(len(high)):
                total = np.float32(0)
                for step in range(window):
                    total += cells[step, k]
                high[k] = total
            for k in range(len(wide)):
                total = np.float32(0)
                for step in range(window):
                    total += high[k + _MOMENTS * step]
                wide[k] = total
            _planes(wide, planes)
            for feature in range(FIT_FEATURES):
                for column in range(width):
                    fits[group, feature, row, column] = planes[feature * width + column]


@njit(nogil=True, fastmath=True, error_model="numpy", inline="always")
def _planes(sums, planes):
    """From a row's moments, window by window, the features of its planes, feature by feature; see `plane_fits`.

    Flat arrays, no branch, and the number of windows written out each time: else the compiler does not make the loop
    run on vectors, and it takes three times as long.
    """
    one, nothing = np.float32(1), np.float32(0)
    for column in range(len(sums) // _MOMENTS):
        k = _MOMENTS * column
        count = max(sums[k], one)
        enough = count >= FEWEST
        per = one / count
        t, x, y = sums[k + 1] * per, sums[k + 3] * per, sums[k + 4] * per
        tt = sums[k + 2] * per - t * t + np.float32(1e-4)
        xx, yy = sums[k + 5] * per - x * x + np.float32(0.5), sums[k + 7] * per - y * y + np.float32(0.5)
        xy, xt, yt = sums[k + 6] * per - x * y, sums[k + 8] * per - x * t, sums[k + 9] * per - y * t
        det = xx * yy - xy * xy
        a, b = (yy * xt - xy * yt) / det, (xx * yt - xy * xt) / det  # slope, slices per px
        explained = (a * xt + b * yt) / tt
        slowness = a * a + b * b + np.float32(0.0016)
        u, v = a / slowness * explained, b / slowness * explained
        spread = np.float32(3) / (np.sqrt(tt) + np.float32(0.05))
        planes[column] = u / (one + abs(u) / np.float32(3)) if enough else nothing
        planes[(len(sums) // _MOMENTS) + column] = v / (one + abs(v) / np.float32(3)) if enough else nothing
        planes[2 * (len(sums) // _MOMENTS) + column] = a * spread if enough else nothing
        planes[3 * (len(sums) // _MOMENTS) + column] = b * spread if enough else nothing
        planes[4 * (len(sums) // _MOMENTS) + column] = explained if enough else nothing
        planes[5 * (len(sums) // _MOMENTS) + column] = np.float32(0.3) * ln(count) if enough else nothing
