"""Which marker is which: a scan's markers against mocap's, whose order is unknown and which may be others."""

from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from evimo.calibrating.rigid import angle_between, fit_rigid, moved
from evimo.errors import BadInput

F8 = NDArray[np.float64]

TOLERANCE = 0.003  # m: mocap's markers are flat discs of light to it; a scan's are spheres
FEWEST = 3
MOST = 40  # markers on a side; more make too many triangles
SMALLEST_TRIANGLE = 1e-5  # m²: a thinner one turns freely around its long side
DIFFERENT_RAD, DIFFERENT = np.radians(5), 0.005  # two answers that differ by more are two


@dataclass(frozen=True, slots=True)
class MarkerMatch:
    """A scan's markers recognised among those of mocap.

    body_from_scan: (4, 4).
    pairs:          (P, 2): numbers of markers in the scan and in mocap that are the same ones.
    errors:         (P,), m: how far apart each pair is left.
    """

    body_from_scan: F8
    pairs: NDArray[np.int64]
    errors: F8

    @property
    def rms(self) -> float:
        """Of the distances that are left, m."""
        return float(np.sqrt((self.errors**2).mean()))


def match_markers(scan: F8, body: F8, *, tolerance: float = TOLERANCE) -> MarkerMatch:
    """The rigid motion under which most markers (N, 3) of a scan meet mocap's (M, 3), in any order, some missing.

    Every triangle of markers is laid on every triangle of the same sides.

    Args:
        scan: m, axes of the scan; balls that are no markers may be among them.
        body: m, axes of the body that mocap tracks.
        tolerance: how far apart two may lie that are the same, m.

    Raises:
        BadInput: fewer than three agree, they lie on a line, or the markers fit in two ways.
    """
    _check(scan, body)
    settled = (_settled(scan, body, each, tolerance) for each in _laid(scan, body, tolerance))
    matches = sorted(filter(None, settled), key=lambda match: (-len(match.pairs), match.rms))
    found: list[MarkerMatch] = []
    for match in matches:  # the best of those that are nearly the same
        if not any(_is_same(match, other) for other in found):
            found.append(match)
    if not found:
        raise BadInput(
            f"no three of the scan's {len(scan)} markers fit mocap's {len(body)} within {1e3 * tolerance:g} mm",
            fix="the mocap of this object, the scan's unit, or a larger --tolerance",
        )
    rivals = [other for other in found[1:] if _rivals(found[0], other)]
    if rivals:
        raise BadInput(
            f"{len(found[0].pairs)} markers fit in {1 + len(rivals)} ways: they are arranged too regularly, or too few",
            fix="name a marker more, or a smaller --tolerance",
        )
    return found[0]


def _check(scan: F8, body: F8) -> None:
    for name, markers in (("the scan", scan), ("mocap", body)):
        if not FEWEST <= len(markers) <= MOST:
            raise BadInput(f"{name} has {len(markers)} markers", fix=f"{FEWEST} to {MOST}")
        if not np.isfinite(markers).all():
            raise BadInput(f"a marker of {name} has no place", fix="leave out those that mocap did not see")


def _laid(scan: F8, body: F8, tolerance: float) -> F8:
    """Rigid motions (K, 4, 4) that lay a triangle of the scan on one of mocap."""
    ours = np.array(list(combinations(range(len(scan)), 3)))
    theirs = np.array(list(permutations(range(len(body)), 3)))
    ours = ours[_area(scan[ours]) > SMALLEST_TRIANGLE]
    if not len(ours):
        raise BadInput("the scan's markers lie on a line", fix="a scan with three markers that span a triangle")
    mine, others = _sides(scan[ours]), _sides(body[theirs])
    laid: list[F8] = []
    for triangle, sides in zip(ours, mine, strict=True):
        fits = (np.abs(others - sides) < 2 * tolerance).all(axis=1)
        laid.append(fit_rigid(body[theirs[fits]], np.broadcast_to(scan[triangle], (int(fits.sum()), 3, 3))))
    return np.concatenate(laid)


def _sides(triangles: F8) -> F8:
    return np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=-1)


def _area(triangles: F8) -> F8:
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return np.linalg.norm(np.cross(first, second), axis=-1) / 2


def _settled(scan: F8, body: F8, body_from_scan: F8, tolerance: float) -> MarkerMatch | None:
    """The match after fitting to all pairs that agree, until these stay; None if fewer than three do."""
    pairs = np.zeros((0, 2), np.int64)
    for _ in range(10):
        away = np.linalg.norm(moved(body_from_scan, scan)[:, None] - body, axis=-1)
        rows, columns = linear_sum_assignment(np.minimum(away, 2 * tolerance))
        near = away[rows, columns] < tolerance
        now = np.stack((rows[near], columns[near]), axis=1)
        if len(now) < FEWEST:
            return None
        if len(now) == len(pairs) and (now == pairs).all():
            break
        pairs = now
        body_from_scan = fit_rigid(body[pairs[:, 1]], scan[pairs[:, 0]])
    errors = np.linalg.norm(moved(body_from_scan, scan[pairs[:, 0]]) - body[pairs[:, 1]], axis=-1)
    return MarkerMatch(body_from_scan, pairs, errors)


def _is_same(one: MarkerMatch, other: MarkerMatch) -> bool:
    turned = float(angle_between(one.body_from_scan, other.body_from_scan))
    apart = np.linalg.norm(one.body_from_scan[:3, 3] - other.body_from_scan[:3, 3])
    return turned < DIFFERENT_RAD and float(apart) < DIFFERENT


def _rivals(best: MarkerMatch, other: MarkerMatch) -> bool:
    """Whether another match explains as many markers nearly as well: mocap's noise could have decided."""
    return len(other.pairs) == len(best.pairs) and other.rms < max(3 * best.rms, 5e-4)
