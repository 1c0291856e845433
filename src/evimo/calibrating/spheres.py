"""Spheres in noisy points: algebraic fits, and RANSAC for points of which many belong to something else."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F8 = NDArray[np.float64]

TRIALS = 400  # with half of the points on the sphere, four of them are drawn together in one of 16 trials
SETTLING = 8  # rounds of least squares over the points that agree


@dataclass(frozen=True, slots=True)
class Sphere:
    """A sphere that was fitted to points, with what the fit leaves.

    centre:  (3,), m.
    radius:  m.
    rms:     of the distances of its points to it, m.
    inliers: (N,) bool: the points that lie on it, of those that were given.
    """

    centre: F8
    radius: float
    rms: float
    inliers: NDArray[np.bool_]


def fit_spheres(points: F8) -> tuple[F8, F8]:
    """The spheres of least algebraic error through groups of points (..., N, 3): centres (..., 3) and radii (...).

    Where four points or more lie in a plane, the radius is huge or 0.
    """
    origin = points.mean(-2, keepdims=True)
    near = points - origin
    scale = np.sqrt((near**2).sum(-1).mean(-1))[..., None, None]
    near = near / np.maximum(scale, 1e-300)
    rows = np.concatenate((2 * near, np.ones((*near.shape[:-1], 1))), axis=-1)
    across = np.swapaxes(rows, -1, -2)
    normal = across @ rows + 1e-12 * np.eye(4)
    solved = np.linalg.solve(normal, across @ (near**2).sum(-1)[..., None])[..., 0]
    squared = solved[..., 3] + (solved[..., :3] ** 2).sum(-1)
    centres = solved[..., :3] * scale[..., 0] + origin[..., 0, :]
    return centres, np.sqrt(np.maximum(squared, 0)) * scale[..., 0, 0]


def find_sphere(
    points: F8, *, radii: tuple[float, float], tolerance: float, rng: np.random.Generator, trials: int = TRIALS
) -> Sphere | None:
    """The sphere on which most of some points (N, 3) lie, found by RANSAC; None where there is none of such a size.

    Args:
        points: m.
        radii: the smallest and the largest radius that counts, m.
        tolerance: how far from the sphere its points may lie, m.
        rng: draws the trials.
        trials: how many groups of four points are tried.
    """
    if len(points) < 8:
        return None
    centres, radius = fit_spheres(points[rng.integers(0, len(points), (trials, 4))])
    fits = (radius >= radii[0]) & (radius <= radii[1])
    if not fits.any():
        return None
    centres, radius = centres[fits], radius[fits]
    away = np.abs(np.linalg.norm(points - centres[:, None], axis=-1) - radius[:, None])
    best = int(np.argmax((away < 2 * tolerance).sum(axis=1)))
    return _settled(points, centres[best], float(radius[best]), radii=radii, tolerance=tolerance)


def _settled(points: F8, centre: F8, radius: float, *, radii: tuple[float, float], tolerance: float) -> Sphere | None:
    """The sphere after least squares over its own points, until these are the same ones; None if it dissolves."""
    kept = np.zeros(len(points), np.bool_)
    for step in range(SETTLING):
        away = np.abs(np.linalg.norm(points - centre, axis=1) - radius)
        inliers = away < (2 * tolerance if step == 0 else tolerance)
        if inliers.sum() < 8:
            return None
        if step and (inliers == kept).all():
            break
        kept = inliers
        centre, fitted = fit_spheres(points[kept])
        radius = float(fitted)
    if not radii[0] <= radius <= radii[1]:
        return None
    away = np.abs(np.linalg.norm(points - centre, axis=1) - radius)
    kept = away < tolerance
    return Sphere(centre, radius, float(np.sqrt((away[kept] ** 2).mean())), kept) if kept.any() else None
