# pyright: basic
"""Compiled kernels of layered motion compensation: images of warped events, and the motion that makes them sharpest.

A motion is (4,) float64: image velocity (u, v) at a centre, expansion s and turn r about it, all in px per slice, the
last two as the speed at `ARM` px from the centre. Events are float32 arrays x, y in px of a small box around an object
and t in slices about the reference slice's centre. Images (h, w) float32 have a margin of `MARGIN` px on each side that
is there to be blurred into.
"""

import numpy as np

from evimo.compiling import njit

ARM = 20.0
MARGIN = 3
STEPS, FIRST_STEP, LONGEST_STEP, LAST_STEP = 14, 0.4, 1.0, 0.02  # of the search, px per slice
PEAK = 0.140625  # of an event's own weight, in the middle of a pixel of the blurred image


@njit(nogil=True, fastmath=True)
def warp_back(x, y, t, motion, centre, at):
    """Where events were at the slice's centre if they moved with `motion`, into `at` (2, N)."""
    u, v, s, r = np.float32(motion[0]), np.float32(motion[1]), np.float32(motion[2] / ARM), np.float32(motion[3] / ARM)
    cx, cy = np.float32(centre[0]), np.float32(centre[1])
    for k in range(len(x)):
        dx, dy = x[k] - cx, y[k] - cy
        at[0, k] = x[k] - t[k] * (u + s * dx - r * dy)
        at[1, k] = y[k] - t[k] * (v + s * dy + r * dx)


@njit(nogil=True, fastmath=True)
def splat(at, weight, image):
    """Sum weights (N,) at places (2, N) into an image, bilinearly; what falls outside is lost."""
    image[:] = 0
    height, width = image.shape[0] - 2 * MARGIN, image.shape[1] - 2 * MARGIN
    for k in range(at.shape[1]):
        x, y = at[0, k], at[1, k]
        if 0 <= x < width - 1 and 0 <= y < height - 1:
            column, row = int(x), int(y)
            fx, fy = x - np.float32(column), y - np.float32(row)
            upper, lower = weight[k] * (np.float32(1) - fy), weight[k] * fy
            column, row = column + MARGIN, row + MARGIN
            image[row, column] += upper * (np.float32(1) - fx)
            image[row, column + 1] += upper * fx
            image[row + 1, column] += lower * (np.float32(1) - fx)
            image[row + 1, column + 1] += lower * fx


@njit(nogil=True, fastmath=True)
def read(at, image, into):
    """Read an image at places (2, N), bilinearly, into (N,); outside is 0."""
    height, width = image.shape[0] - 2 * MARGIN, image.shape[1] - 2 * MARGIN
    for k in range(at.shape[1]):
        x, y = at[0, k], at[1, k]
        into[k] = 0
        if 0 <= x < width - 1 and 0 <= y < height - 1:
            column, row = int(x), int(y)
            fx, fy = x - column, y - row
            column, row = column + MARGIN, row + MARGIN
            above = (1 - fx) * image[row, column] + fx * image[row, column + 1]
            below = (1 - fx) * image[row + 1, column] + fx * image[row + 1, column + 1]
            into[k] = (1 - fy) * above + fy * below


@njit(nogil=True, fastmath=True)
def blur(image, across, into):
    """Blur by the binomial (1 4 6 4 1)/16 in both directions; the outermost two pixels become 0. `across` is room.

    Five lines are read at one index, so that the compiler takes several pixels at a time.
    """
    a, b, c = np.float32(0.0625), np.float32(0.25), np.float32(0.375)
    into[:] = 0
    for row in range(len(image)):
        line, target = image[row], across[row, 2:-2]
        far_left, left, middle, right, far_right = line[:-4], line[1:-3], line[2:-2], line[3:-1], line[4:]
        for k in range(len(target)):
            target[k] = a * (far_left[k] + far_right[k]) + b * (left[k] + right[k]) + c * middle[k]
    for row in range(2, len(image) - 2):
        far_up, up, level = across[row - 2, 2:-2], across[row - 1, 2:-2], across[row, 2:-2]
        down, far_down, target = across[row + 1, 2:-2], across[row + 2, 2:-2], into[row, 2:-2]
        for k in range(len(target)):
            target[k] = a * (far_up[k] + far_down[k]) + b * (up[k] + down[k]) + c * level[k]


@njit(nogil=True, fastmath=True)
def sharpness(at, weight, images):
    """Sum of squares of the blurred image of weights at places (2, N); that image is left in images[2] of (3, h, w)."""
    splat(at, weight, images[0])
    blur(images[0], images[1], images[2])
    total = np.float32(0)
    soft = images[2]
    for row in range(soft.shape[0]):
        line = soft[row]
        for k in range(soft.shape[1]):
            total += line[k] * line[k]
    return total


@njit(nogil=True, fastmath=True)
def sharpness_slope(x, y, t, weight, motion, centre, at, images, slope):
    """`sharpness` of events warped back by `motion`, and its exact derivative by the motion, into `slope` (4,).

    The blur is its own adjoint, so the derivative is read from the image blurred twice.
    """
    warp_back(x, y, t, motion, centre, at)
    total = sharpness(at, weight, images)
    blur(images[2], images[1], images[0])
    image = images[0]
    slope[:] = 0
    cx, cy, short = np.float32(centre[0]), np.float32(centre[1]), np.float32(1 / ARM)
    height, width = image.shape[0] - 2 * MARGIN, image.shape[1] - 2 * MARGIN
    for k in range(len(x)):
        if 0 <= at[0, k] < width - 1 and 0 <= at[1, k] < height - 1:
            column, row = int(at[0, k]), int(at[1, k])
            fx, fy = at[0, k] - np.float32(column), at[1, k] - np.float32(row)
            gx, gy = np.float32(1) - fx, np.float32(1) - fy
            column, row = column + MARGIN, row + MARGIN
            a, b = image[row, column], image[row, column + 1]
            c, d = image[row + 1, column], image[row + 1, column + 1]
            pull = np.float32(-2) * t[k] * weight[k]
            along_x = pull * ((b - a) * gy + (d - c) * fy)
            along_y = pull * ((c - a) * gx + (d - b) * fx)
            dx, dy = (x[k] - cx) * short, (y[k] - cy) * short
            slope[0] += along_x
            slope[1] += along_y
            slope[2] += along_x * dx + along_y * dy
            slope[3] += along_y * dx - along_x * dy
    return total


@njit(nogil=True, fastmath=True)
def sharpest(x, y, t, weight, start, centre, spread, images):
    """The motion near `start` that makes weighted events sharpest: log sharpness minus half the squared changes over
    `spread` (4,).

    Each component has a step of its own, longer while its slope keeps the sign and halved where it turns (Rprop), so
    that no scale has to be known.
    """
    motion, best, at = start.copy(), start.copy(), np.empty((2, len(x)), np.float32)
    slope, before, step = np.zeros(4), np.zeros(4), np.full(4, FIRST_STEP)
    highest = -1e30
    for _ in range(STEPS):
        value = max(sharpness_slope(x, y, t, weight, motion, centre, at, images, slope), 1e-9)
        score = np.log(value)
        for k in range(4):
            off = (motion[k] - start[k]) / spread[k]
            score -= 0.5 * off * off
            slope[k] = slope[k] / value - off / spread[k]
        if score > highest:
            highest = score
            best[:] = motion
        for k in range(4):
            if slope[k] * before[k] > 0:
                step[k] = min(1.3 * step[k], LONGEST_STEP)
            elif slope[k] * before[k] < 0:
                step[k] *= 0.5
            before[k] = slope[k]
            motion[k] += np.sign(slope[k]) * step[k]
        if step.max() < LAST_STEP:
            break
    return best
