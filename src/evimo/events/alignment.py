"""How a gyroscope is fixed to its camera: axes, bias, delay and scale, found from rotations that events tell."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.events.gyroscope import Gyroscope
from evimo.events.slices import SLICE_US

F8 = NDArray[np.float64]

DELAYS_US = np.arange(-100_000, 100_001, 5_000)
FINER_US = (1_000, 200)
FEWEST, MOST = 20, 2_000  # slices; of more, every so many-th
LEAST_TURN = 0.01  # rad/s, root mean square of the gyroscope's rate about its mean: less is noise
SCALES = (0.1, 10.0)
SMALLEST_SPREAD = 1e-6  # rad/s
LEAST_EXPLAINED = 0.5
CLEARLY = 0.9  # errors of the best axes have at most this share of those of the second best
LEAST_GAIN = 10.0  # and they are e to this power likelier
ALIKE = 4  # this many neighbouring slices err alike: together they count as one
ROUNDS = 20
AXES = (
    np.array(
        [
            matrix
            for order in permutations(range(3))
            for signs in product((1, -1), repeat=3)
            if np.linalg.det(matrix := np.eye(3)[list(order)] * np.array(signs)[:, None]) > 0
        ]
    )
    + 0.0
)  # (24, 3, 3): all rotations that map axes onto axes; without negative zeros


@dataclass(frozen=True, eq=False)
class Alignment:
    """The mapping of a gyroscope into camera axes: rate(t) = scale * axes @ (gyroscope(t + delay) - bias).

    axes:      (3, 3) camera from gyroscope, a rotation by multiples of 90 degrees.
    bias:      (3,) rad/s, in the gyroscope's own axes.
    delay_us:  how much later than the events' clock the gyroscope's clock is.
    scale:     1 where the gyroscope is right and the rotations from events are, too.
    explained: the share of the rotations' variance that the gyroscope explains, outliers left out.
    """

    axes: F8
    bias: F8
    delay_us: int
    scale: float
    explained: float

    def apply(self, gyroscope: Gyroscope) -> Gyroscope:
        """The same samples in camera axes and in the events' clock, without bias."""
        rate = self.scale * (gyroscope.rate - self.bias) @ self.axes.T
        return Gyroscope(gyroscope.t_us - self.delay_us, rate, True, f"{gyroscope.source}, aligned")

    def __str__(self) -> str:
        named = ", ".join(
            f"{camera} = {'-' if row.sum() < 0 else ''}g{'xyz'[int(np.abs(row).argmax())]}"
            for camera, row in zip("xyz", self.axes, strict=True)
        )
        bias = " ".join(f"{value:.4f}" for value in self.bias)
        return (
            f"axes {named}; bias {bias} rad/s; delay {self.delay_us / 1e3:.1f} ms; scale {self.scale:.3f}; "
            f"{self.explained:.0%} explained"
        )


class _Fit(NamedTuple):
    """One choice of axes (its number) at one delay; cost is minus the logarithm of the likelihood."""

    cost: float
    number: int
    delay_us: int
    scale: float
    offset: F8
    spread: float
    explained: float


class _Rotations(NamedTuple):
    """What events say of M slices: centres in µs, angular velocities (M, 3), weights (M,) with mean 1."""

    times_us: NDArray[np.int64]
    rate: F8
    weight: F8


def aligned(gyroscope: Gyroscope, times_us: NDArray[np.int64], rotation: F8, weight: F8) -> Alignment | None:
    """Find how a gyroscope is fixed to the camera, from angular velocities that were estimated from events.

    Each of the 24 ways to put the gyroscope's axes on the camera's is tried with delays within 100 ms; scale and bias
    are fitted as if errors were distributed as Cauchy's are, so that a third may be outliers.

    Args:
        gyroscope: in its own axes.
        times_us: (M,) centres of slices of 25 ms.
        rotation: (M, 3) mean angular velocity of the camera in each, rad/s, in camera axes; rows may be NaN.
        weight: (M,) trust in each, at least 0; only ratios matter.

    Returns:
        The best, or None where slices or motion are too few, or another choice of axes is nearly as good: a camera
        that turns about one axis alone does not tell the two others apart.
    """
    rotations = _usable(gyroscope, times_us, rotation, weight)
    if rotations is None:
        return None
    fits = _fits(gyroscope, rotations)
    if not fits or fits[0].explained < LEAST_EXPLAINED or not _clearly_best(fits):
        return None
    best = fits[0]
    axes = AXES[best.number]
    return Alignment(axes, -axes.T @ best.offset / best.scale, best.delay_us, best.scale, best.explained)


def _usable(gyroscope: Gyroscope, times_us: NDArray[np.int64], rotation: F8, weight: F8) -> _Rotations | None:
    """The slices that say something and have samples at every delay; None where they or their motion are too few."""
    reach = SLICE_US // 2 - int(DELAYS_US[0])
    _, covered = gyroscope.mean_rates(times_us - reach, times_us + reach)
    kept = np.flatnonzero(np.isfinite(rotation).all(axis=1) & np.isfinite(weight) & (weight > 0) & covered)
    kept = kept[:: -(-len(kept) // MOST) or 1]
    if len(kept) < FEWEST:
        return None
    rate = _delayed(gyroscope, times_us[kept], 0)
    if np.sqrt(((rate - rate.mean(axis=0)) ** 2).sum(axis=1).mean()) < LEAST_TURN:
        return None
    trust = weight[kept].astype(np.float64)
    return _Rotations(times_us[kept], rotation[kept].astype(np.float64), trust / trust.mean())


def _delayed(gyroscope: Gyroscope, times_us: NDArray[np.int64], delay_us: int) -> F8:
    """The gyroscope's mean rates (M, 3) over slices."""
    start = times_us - SLICE_US // 2 + delay_us
    return gyroscope.mean_rates(start, start + SLICE_US)[0]


def _fits(gyroscope: Gyroscope, rotations: _Rotations) -> list[_Fit]:
    """The best fit of the best axes, then that of the second best; fewer where the others turn the wrong way."""
    best: dict[int, _Fit] = {}
    for delay in DELAYS_US.tolist():
        for fit in _fitted(gyroscope, rotations, range(len(AXES)), delay):
            if fit.number not in best or fit.cost < best[fit.number].cost:
                best[fit.number] = fit
    nearest = sorted(best.values(), key=lambda fit: fit.cost)[:2]
    return sorted((_finer(gyroscope, rotations, fit) for fit in nearest), key=lambda fit: fit.cost)


def _finer(gyroscope: Gyroscope, rotations: _Rotations, fit: _Fit) -> _Fit:
    """The same axes with the delay that fits best between the coarse ones."""
    step = int(DELAYS_US[1] - DELAYS_US[0])
    for finer in FINER_US:
        low, high = max(fit.delay_us - step, int(DELAYS_US[0])), min(fit.delay_us + step, int(DELAYS_US[-1]))
        tried = [_fitted(gyroscope, rotations, [fit.number], delay) for delay in range(low, high + 1, finer)]
        fit = min((each for fits in tried for each in fits), key=lambda each: each.cost, default=fit)
        step = finer
    return fit


def _fitted(gyroscope: Gyroscope, rotations: _Rotations, numbers: Sequence[int], delay_us: int) -> list[_Fit]:
    """Scale and offset of K choices of axes at one delay, most likely under Cauchy errors of a spread fitted, too."""
    turned = np.einsum("kij,mj->kmi", AXES[list(numbers)], _delayed(gyroscope, rotations.times_us, delay_us))
    found = _solved(turned, rotations, np.ones(turned.shape[:2]))
    for _ in range(ROUNDS):
        found = _solved(turned, rotations, 4 / (1 + found.error / found.variance[:, None]))
    tails = 1.5 * np.log(found.variance)[:, None] + 2 * np.log1p(found.error / found.variance[:, None])
    cost = (rotations.weight * tails).sum(axis=1)
    return [
        _Fit(float(cost[k]), n, delay_us, float(scale), found.offset[k], float(spread), float(explained))
        for k, (n, scale, spread, explained) in enumerate(
            zip(numbers, found.scale, np.sqrt(found.variance), found.explained, strict=True)
        )
        if SCALES[0] <= scale <= SCALES[1]
    ]


class _Solution(NamedTuple):
    """Of K choices of axes: scales (K,), offsets (K, 3), squared errors (K, M), their variance, what is explained."""

    scale: F8
    offset: F8
    error: F8
    variance: F8
    explained: F8


def _solved(turned: F8, rotations: _Rotations, tail: F8) -> _Solution:
    """Least squares of the rotations by scale * turned (K, M, 3) + offset, slices weighted by trust and tail (K, M)."""
    weight = (rotations.weight * tail)[..., None]
    total = weight.sum(axis=1)
    x_mean, y_mean = (weight * turned).sum(axis=1) / total, (weight * rotations.rate).sum(axis=1) / total
    x, y = turned - x_mean[:, None], rotations.rate - y_mean[:, None]
    scale = (weight * x * y).sum(axis=(1, 2)) / (weight * x * x).sum(axis=(1, 2))
    error = ((y - scale[:, None, None] * x) ** 2).sum(axis=2)
    lost = (weight[..., 0] * error).sum(axis=1)
    variance = np.maximum(lost / (3 * rotations.weight.sum()), SMALLEST_SPREAD**2)
    explained = 1 - lost / np.maximum((weight * y * y).sum(axis=(1, 2)), SMALLEST_SPREAD**2)
    return _Solution(scale, y_mean - scale[:, None] * x_mean, error, variance, explained)


def _clearly_best(fits: list[_Fit]) -> bool:
    """Whether the first fit is much likelier than the second, and its errors are smaller by enough to matter."""
    if len(fits) < 2:
        return True
    gain = (fits[1].cost - fits[0].cost) / ALIKE
    return gain >= LEAST_GAIN and fits[0].spread <= CLEARLY * fits[1].spread
