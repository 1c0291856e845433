"""A camera from points whose places are known: the direct linear transform, and RANSAC where some are mistaken."""

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.calibrating.rigid import pose
from evimo.errors import BadInput

F8 = NDArray[np.float64]

TRIALS = 400
DRAWN = 4  # images in a trial
LARGEST_PX = 20.0  # errors beyond do not get worse
GATE_PX = 10.0  # an image whose mean error is larger is mistaken; lenses bend by some px
FEWEST = 12  # points, for eleven numbers


def fit_projection(points: F8, px: F8) -> F8:
    """The matrix (3, 4) that projects points (N, 3) to pixels (N, 2) with the least algebraic error (DLT).

    Points in one plane do not determine it.
    """
    middle, size = points.mean(axis=0), points.std()
    centre, spread = px.mean(axis=0), px.std()
    near = np.c_[(points - middle) / size, np.ones(len(points))]
    x, y = ((px - centre) / spread).T[..., None]
    none = np.zeros_like(near)
    rows = np.concatenate((np.c_[near, none, -x * near], np.c_[none, near, -y * near]))
    solved = np.linalg.eigh(rows.T @ rows)[1][:, 0].reshape(3, 4)
    shrink, grow = np.diag([1 / size] * 3 + [1.0]), np.diag([spread, spread, 1.0])
    shrink[:3, 3], grow[:2, 2] = -middle / size, centre
    return grow @ solved @ shrink


def projected(projection: F8, points: F8) -> F8:
    """Pixels (..., 2) of points (..., 3)."""
    seen = points @ projection[:, :3].T + projection[:, 3]
    return seen[..., :2] / np.where(seen[..., 2:] == 0, 1e-12, seen[..., 2:])


def resect(points: F8, px: F8, images: NDArray[np.int64], rng: np.random.Generator) -> tuple[F8, NDArray[np.bool_]]:
    """A projection (3, 4) that suits most images, and which of the points (N,) belong to images that it suits.

    Args:
        points: (N, 3), m, all in the axes of the rig.
        px: (N, 2).
        images: (N,): the image of each point; those of one are right or mistaken together.
        rng: draws the trials.

    Raises:
        BadInput: no projection suits enough of them.
    """
    _, image = np.unique(images, return_inverse=True)
    count = np.bincount(image)
    best, chosen = np.inf, None
    for _ in range(TRIALS if len(count) > DRAWN else 1):
        drawn = np.isin(image, rng.choice(len(count), min(DRAWN, len(count)), replace=False))
        if drawn.sum() < 6:
            continue
        errors = _errors(fit_projection(points[drawn], px[drawn]), points, px, image) / count
        if (score := np.minimum(errors, LARGEST_PX).sum()) < best:
            best, chosen = score, errors < GATE_PX
    kept = np.zeros(len(points), np.bool_) if chosen is None else chosen[image]
    if kept.sum() < FEWEST:
        raise BadInput(
            f"no camera fits the {len(count)} images in which the target was found",
            fix="more images from all over the field of view, at several distances, and the right --offset",
        )
    return fit_projection(points[kept], px[kept]), kept


def _errors(projection: F8, points: F8, px: F8, image: NDArray[np.int64]) -> F8:
    """Sums over the points of each image, px."""
    return np.asarray(np.bincount(image, np.linalg.norm(projected(projection, points) - px, axis=1)), np.float64)


def taken_apart(projection: F8) -> tuple[F8, F8]:
    """Intrinsics (3, 3) and the pose `cam_from_rig` (4, 4) of a projection, with the points in front of the camera."""
    matrix, turn = (np.asarray(each, np.float64) for each in cv2.decomposeProjectionMatrix(projection)[:2])
    signs = np.diag(np.sign(np.diag(matrix)))
    matrix, turn = matrix @ signs, signs @ turn
    place = np.asarray(np.linalg.solve(matrix, projection[:, 3]), np.float64)
    if np.linalg.det(turn) < 0:  # a projection means the same with the other sign
        turn, place = -turn, -place
    return matrix / matrix[2, 2], pose(turn, place)
