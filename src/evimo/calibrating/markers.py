"""Mocap markers in a scan: small balls that stick out of it, found without anybody cutting them out by hand."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from evimo.calibrating.spheres import Sphere, find_sphere, fit_spheres

F8 = NDArray[np.float64]

RADII = (0.002, 0.009)  # m: of balls of 4 to 18 mm
TOLERANCE = 0.00015  # m: industrial scanners are good for a tenth of a millimetre; a base's rim is not
NEIGHBOURS = 24  # points of a patch through which a sphere is fitted
AGREE = 0.15  # centres of patches of one ball lie within this share of its radius
FEWEST = 12  # patches that agree
LEAST_COVERED = 0.45  # of a ball's surface; what is round on an object shows less
CELLS = 200  # directions at which coverage is counted
REACH = 1.6  # a point covers directions as far as this times the distance to its nearest neighbour
DRIFT = 0.3  # of a radius: a ball whose centre lies farther from the votes for it is another thing
PATCHES_AT_ONCE = 50_000  # bounds memory


@dataclass(frozen=True, slots=True)
class Marker:
    """A ball in a scan.

    centre:   (3,), m, axes of the scan.
    radius:   m.
    rms:      of its points' distances to it, m.
    points:   how many points of the scan lie on it.
    coverage: the share of its surface with points; its base and shadows take the rest.
    """

    centre: F8
    radius: float
    rms: float
    points: int
    coverage: float


def locate_markers(
    points: F8, *, radii: tuple[float, float] = RADII, tolerance: float = TOLERANCE, seed: int = 0
) -> tuple[Marker, ...]:
    """The balls in a scan (N, 3), the most complete first.

    Every patch of the scan votes for the centre of the sphere through it, patches that agree propose a ball, and
    RANSAC over the points around finds it exactly.

    Args:
        points: of the whole scan, m.
        radii: the smallest and the largest that count, m.
        tolerance: how far from a ball its points may lie, m.
        seed: of RANSAC's trials.
    """
    rng = np.random.default_rng(seed)
    tree = KDTree(points)
    spacing = _spacing(points, tree)
    found: list[Marker] = []
    for centre, radius in _proposals(points, radii):
        near = points[tree.query_ball_point(centre, 1.6 * radius)]
        sphere = find_sphere(near, radii=radii, tolerance=tolerance, rng=rng)
        if sphere is None or np.linalg.norm(sphere.centre - centre) > DRIFT * radius:
            continue
        marker = as_marker(near, sphere, spacing)
        overlaps = (np.linalg.norm(marker.centre - other.centre) < max(marker.radius, other.radius) for other in found)
        if marker.coverage >= LEAST_COVERED and not any(overlaps):
            found.append(marker)
    return tuple(sorted(found, key=lambda marker: -marker.coverage))


def marker_of_piece(points: F8, *, radii: tuple[float, float] = RADII, seed: int = 0) -> Marker | None:
    """The one ball in points (N, 3) that were cut out around it, if there is one; rims and bases may be among them."""
    rng = np.random.default_rng(seed)
    sphere = find_sphere(points, radii=radii, tolerance=TOLERANCE, rng=rng)
    return None if sphere is None else as_marker(points, sphere, _spacing(points, KDTree(points)))


def as_marker(points: F8, sphere: Sphere, spacing: float) -> Marker:
    """A sphere with how much of its surface its points, of (N, 3) at such a distance from each other, cover."""
    ways = (points[sphere.inliers] - sphere.centre) / sphere.radius
    covered = (_directions() @ ways.T).max(axis=1) > np.cos(min(REACH * spacing / sphere.radius, np.pi / 2))
    return Marker(sphere.centre, sphere.radius, sphere.rms, int(sphere.inliers.sum()), float(covered.mean()))


def _proposals(points: F8, radii: tuple[float, float]) -> list[tuple[F8, float]]:
    """Centres and radii on which many patches agree, most first."""
    thinned = _thinned(points, radii[0] / 4)
    if len(thinned) < NEIGHBOURS:
        return []
    tree = KDTree(thinned)
    fitted: list[tuple[F8, F8]] = []
    for first in range(0, len(thinned), PATCHES_AT_ONCE):
        _, near = tree.query(thinned[first : first + PATCHES_AT_ONCE], k=NEIGHBOURS)
        fitted.append(fit_spheres(thinned[near]))
    centres, sizes = (np.concatenate(each) for each in zip(*fitted, strict=True))
    fits = (sizes >= 0.8 * radii[0]) & (sizes <= 1.2 * radii[1])
    centres, sizes = centres[fits], sizes[fits]
    if not len(centres):
        return []
    votes = KDTree(centres).query_ball_point(centres, AGREE * sizes, return_length=True)
    order = np.argsort(-votes, kind="stable")[: int((votes >= FEWEST).sum())]
    return _apart(centres[order], sizes[order])


def _apart(centres: F8, sizes: F8) -> list[tuple[F8, float]]:
    """Proposals without those whose centre lies within half a radius of an earlier one's."""
    near = KDTree(centres).query_ball_point(centres, sizes / 2)
    kept: list[tuple[F8, float]] = []
    passed = np.zeros(len(centres), np.bool_)
    for at, those in enumerate(near):
        if not passed[at]:
            passed[those] = True
            kept.append((centres[at], float(sizes[at])))
    return kept


def _spacing(points: F8, tree: KDTree) -> float:
    """The usual distance from a point to its nearest neighbour, m."""
    some = points[:: max(1, len(points) // 2000)]
    return float(np.median(tree.query(some, k=2)[0][:, 1]))


def _thinned(points: F8, spacing: float) -> F8:
    """One point of every cube of this size, so that a patch is large against the scanner's noise."""
    cubes = np.floor((points - points.min(axis=0)) / spacing).astype(np.int64)
    _, first = np.unique(cubes, axis=0, return_index=True)
    return points[np.sort(first)]


def _directions() -> F8:
    """Unit vectors (CELLS, 3) spread evenly (Fibonacci's spiral)."""
    number = np.arange(CELLS) + 0.5
    polar, turn = np.arccos(1 - 2 * number / CELLS), np.pi * (1 + np.sqrt(5)) * number
    return np.stack((np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)), axis=1)
