# pyright: basic
"""Direct alignment: the twist corrected until the static world is sharp, from the events themselves.

A network's flow leans towards nothing where events are few or noisy: of a slow camera's motion it saw a quarter. The
slices of a compensated stack are images of one world, and where the compensation is wrong they are shifted against each
other. The correction that shifts them back, by the motion field of a twist (paper, eq. 1), is found by least squares
over the whole image (Lucas and Kanade, 1981), robustly: what moves by itself loses its say. Each part of the image
counts alike, whatever the number of its events, or a mover in front of a wall would be all that counts.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.compiling import njit
from evimo.events.images import blurred, gaussian
from evimo.events.local_motion import PRODUCTS, TT, XT, XX, XY, YT, YY, add_products
from evimo.events.stack import SLICES, EventStack, StaticMotion, compensated

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]

FEWEST = 300  # events of a stack that can be aligned
STEP, CELL = 2, 4  # px of the rectified image per pixel of the counts, and pixels of these per cell
SHARP, NEAR = 0.5, 2.0  # blur of the counts, pixels; of the number of events around a cell, cells
QUIET = 0.1  # of the mean number of events, which a cell's is raised by
LOUDEST = 16.0  # of a typical cell's contrast, what one cell is allowed: a hot pixel in an empty place has thousands
ROUNDS, KNEE = 6, 8.0  # of reweighting; how much less than the mean's a cell's error must be to keep its say
PRIOR = 10.0  # cells' worth of evidence that the twist is right, and more of a camera that is seen at rest:
RESTING, LEAST = 1.2, 0.1  # px per slice: slower ones are believed, lest a few events of a mover lead them away
KNOWN = 1e6  # the same for a rotation that a gyroscope measured
BASELINES = ((0, 2, 4), (0, 1, 2), (1, 2, 3), (2, 3, 4))  # slices before, at and after


def aligned(stack: EventStack, motion: StaticMotion, *, known_rotation: bool = False) -> StaticMotion:
    """The motion with its twists corrected, all five alike, so that the compensated slices lie on each other.

    Args:
        stack: events as they come.
        motion: what a first pass found; its depth is believed.
        known_rotation: leave the rotation as it is.
    """
    correction = twist_correction(compensated(stack, motion), motion, known_rotation=known_rotation)
    return motion._replace(twist=motion.twist + correction.astype(np.float32))


def twist_correction(sharp: EventStack, motion: StaticMotion, *, known_rotation: bool) -> F8:
    """What the twist of a compensation lacks, (6,) mean depths and rad per slice, from the compensated events."""
    height, width = (side * motion.step // (STEP * CELL) for side in motion.inv_depth.shape)
    if len(sharp.t) < FEWEST or not height or not width:
        return np.zeros(6)
    counts = np.zeros((SLICES, 2, CELL * height, CELL * width), np.float32)
    _count(sharp, counts)
    products = _products(counts)
    basis = _basis(motion, height, width)
    speed = STEP * np.sqrt(np.square(np.tensordot(motion.twist[SLICES // 2], basis, 1)).sum(0).mean())
    belief = PRIOR * (1 + (RESTING / (speed + LEAST)) ** 2)
    prior = belief * np.square(basis, dtype=np.float64).sum(1).mean((1, 2)) * STEP**2
    if known_rotation:
        prior[3:] *= KNOWN
    correction: F8 = np.zeros(6)
    say = np.ones((height, width), np.float32)
    for _ in range(ROUNDS):
        matrix, right = np.zeros((6, 6)), np.zeros(6)
        noise = _normal_equations(products, basis, say, matrix, right)
        correction = np.linalg.solve(matrix + (noise + 1e-9) * np.diag(prior), right).astype(np.float64)
        _reweight(products, basis, correction.astype(np.float32), say)
    return correction


def _products(counts: F4) -> F4:
    """Products of slopes in cells, (6, a, b), of all baselines, over the number of events around each cell."""
    sharp = [blurred(each, gaussian(SHARP)) for each in counts]
    height, width = (side // CELL for side in counts.shape[2:])
    products = np.zeros((PRODUCTS, CELL // 2 * height, CELL // 2 * width), np.float32)
    for before, here, after in BASELINES:
        add_products(sharp[before], sharp[here], sharp[after], after - before, products)
    products = products.reshape(PRODUCTS, height, CELL // 2, width, CELL // 2).mean((2, 4))
    by_cell = counts.sum((0, 1)).reshape(height, CELL, width, CELL).mean((1, 3))
    near = np.asarray(cv2.GaussianBlur(by_cell, (0, 0), NEAR), np.float32) + np.float32(QUIET) * by_cell.mean()
    products /= np.square(near + np.float32(1e-6))
    contrast = products[XX] + products[YY]
    loudest = np.float32(LOUDEST) * np.square(np.sqrt(contrast).mean())
    return products * np.minimum(1, loudest / (contrast + np.float32(1e-12)))


def _basis(motion: StaticMotion, height: int, width: int) -> F4:
    """(6, 2, a, b) flow of each cell, px of the counts per slice, for a unit of each component of the twist."""
    fx, fy, cx, cy = motion.intrinsics
    rows, columns = ((np.arange(n) + 0.5) * CELL * STEP for n in (height, width))
    inv_z = motion.inv_depth[(rows / motion.step).astype(int)][:, (columns / motion.step).astype(int)]
    x, y = np.meshgrid((columns - 0.5 - cx) / fx, (rows - 0.5 - cy) / fy)
    nothing = 0 * x
    u = (-inv_z, nothing, inv_z * x, x * y, -(1 + x * x), y)
    v = (nothing, -inv_z, inv_z * y, 1 + y * y, -x * y, -x)
    return np.stack((np.stack(u) * (fx / STEP), np.stack(v) * (fy / STEP)), axis=1).astype(np.float32)


@njit(nogil=True, fastmath=True)
def _count(stack, counts):
    """Events by slice and polarity, each shared between four pixels; what is outside is left out."""
    height, width = counts.shape[2:]
    half, scale = np.float32(0.5), np.float32(1 / STEP)
    for e in range(len(stack.t)):
        x, y = (stack.x[e] + half) * scale - half, (stack.y[e] + half) * scale - half
        if not (0 <= x < width - 1 and 0 <= y < height - 1):
            continue
        n = min(max(int(stack.t[e] + np.float32(SLICES / 2)), 0), SLICES - 1)
        image = counts[n, 0 if stack.positive[e] else 1]
        left, top = int(x), int(y)
        ax, ay = x - np.float32(left), y - np.float32(top)
        image[top, left] += (1 - ax) * (1 - ay)
        image[top, left + 1] += ax * (1 - ay)
        image[top + 1, left] += (1 - ax) * ay
        image[top + 1, left + 1] += ax * ay


@njit(nogil=True, fastmath=True)
def _normal_equations(products, basis, say, matrix, right):
    """Add up the weighted normal equations of a twist (6, 6) and (6,); returns what changes in a cell, on average."""
    noise = total = 0.0
    for row in range(say.shape[0]):
        for column in range(say.shape[1]):
            weight, xx, xy, yy = (
                say[row, column],
                products[XX, row, column],
                products[XY, row, column],
                products[YY, row, column],
            )
            xt, yt = products[XT, row, column], products[YT, row, column]
            noise += weight * products[TT, row, column]
            total += weight
            for i in range(6):
                u, v = basis[i, 0, row, column], basis[i, 1, row, column]
                along_x, along_y = weight * (u * xx + v * xy), weight * (u * xy + v * yy)
                right[i] -= weight * (u * xt + v * yt)
                for j in range(6):
                    matrix[i, j] += along_x * basis[j, 0, row, column] + along_y * basis[j, 1, row, column]
    return noise / total


@njit(nogil=True, fastmath=True)
def _reweight(products, basis, correction, say):
    """What each cell has to say, by the change that the correction leaves for its contrast (Cauchy's weights)."""
    floor = np.float32(0.3) * (products[XX] + products[YY]).mean() + np.float32(1e-9)
    left = np.empty_like(say)
    errors = contrasts = 0.0
    for row in range(say.shape[0]):
        for column in range(say.shape[1]):
            u = v = np.float32(0)
            for i in range(6):
                u += correction[i] * basis[i, 0, row, column]
                v += correction[i] * basis[i, 1, row, column]
            xx, xy, yy = products[XX, row, column], products[XY, row, column], products[YY, row, column]
            change = products[TT, row, column] + 2 * (products[XT, row, column] * u + products[YT, row, column] * v)
            change += xx * u * u + 2 * xy * u * v + yy * v * v
            left[row, column] = change / (xx + yy + floor)
            errors += left[row, column] * (xx + yy)
            contrasts += xx + yy
    scale = np.float32(KNEE * contrasts / (errors + 1e-12))
    for row in range(say.shape[0]):
        for column in range(say.shape[1]):
            say[row, column] = 1 / (1 + scale * left[row, column])
