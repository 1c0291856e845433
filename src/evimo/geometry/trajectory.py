"""Where a rigid body is at any time, and how fast it moves: cubic splines of poses on SE(3).

The spline is one of translations and quaternions, whose quaternion is brought back to unit length: turning the world
or the body turns it with them, since quaternions multiply by orthogonal matrices. It is fitted to all samples by
least squares, with fewer knots than samples where these are dense, so that the jitter of motion capture, which
differences of poses would turn into cm/s, averages out.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.geometry.pose_samples import BRIDGED_US, checked_samples, pieces_of
from evimo.geometry.rotations import matrices_of_quaternions, poses_of, quaternions_of_matrices
from evimo.geometry.spline_fit import fitted_controls, weights_of

F8 = NDArray[np.float64]

KNOT_US = 20_000  # at least, between knots: a hand's motion, and five samples of motion capture at 200 Hz
ROUNDS = 12  # of fits, each without the samples that lie farthest from the one before
NEAR = 4  # samples to each side, which a bad one draws away from the path with it
FAR = 6.0  # standard deviations
FAR_M, FAR_RAD = 1e-3, 5e-3  # what is nearer is never far


@dataclass(frozen=True, slots=True)
class Motion:
    """Where a body is and how it moves at M times.

    world_from_body: (M, 4, 4). twist: (M, 6) relative to the world in the body's own axes, m/s and rad/s.
    valid:           (M,) bool; where false, the others mean nothing.
    """

    world_from_body: F8
    twist: F8
    valid: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Trajectory:
    """A body's path, made by `fit_trajectory`: one spline for each piece between gaps that are too long to bridge.

    starts_us, stops_us: (P,) int64, first and last good sample of each piece.
    first:    (P,) int64, the first control of each piece.
    controls: (K, 7) translation in m and quaternion.
    knot_us:  between knots.
    bad:      (N,) bool, which samples were left out.
    """

    starts_us: NDArray[np.int64]
    stops_us: NDArray[np.int64]
    first: NDArray[np.int64]
    controls: F8
    knot_us: int
    bad: NDArray[np.bool_]

    def at(self, times_us: NDArray[np.int64]) -> Motion:
        """Poses and twists at times (M,); not valid before, after and between the pieces."""
        times_us = np.asarray(times_us, np.int64)
        if not len(self.starts_us):
            nothing = np.zeros(len(times_us), np.bool_)
            return Motion(np.tile(np.eye(4), (len(times_us), 1, 1)), np.zeros((len(times_us), 6)), nothing)
        piece = np.searchsorted(self.starts_us, times_us, side="right") - 1
        valid = (piece >= 0) & (times_us <= self.stops_us[piece])
        piece = np.maximum(piece, 0)
        at_us = np.clip(times_us, self.starts_us[piece], self.stops_us[piece])
        knot, weights, rates = weights_of(at_us - self.starts_us[piece], self.knot_us)
        near = self.controls[(self.first[piece] + knot)[:, None] + np.arange(4)]
        value = np.einsum("mk,mkc->mc", weights, near)
        rate = np.einsum("mk,mkc->mc", rates, near) * (1e6 / self.knot_us)
        rotation = matrices_of_quaternions(value[:, 3:])
        velocity = np.einsum("mji,mj->mi", rotation, rate[:, :3])
        twist = np.concatenate((velocity, _turning(value[:, 3:], rate[:, 3:])), axis=1)
        return Motion(poses_of(value[:, :3], rotation), twist, valid)


def fit_trajectory(
    times_us: NDArray[np.int64], poses: F8, *, knot_us: int | None = None, bridged_us: int = BRIDGED_US
) -> Trajectory:
    """Fit a trajectory to samples of a body's pose: bad ones are left out, short gaps bridged, long ones left void.

    Bad are samples that are no rigid motion, go back in time, jump there and back faster than anything moves, or lie
    far from the path of the others. A jump without return, as when motion capture swaps markers, ends a piece.

    Args:
        times_us: (N,) of the samples. poses: (N, 4, 4), world_from_body; unknown ones hold NaN.
        knot_us: between knots; by default 20 ms, or the samples' own distance where that is longer.
        bridged_us: the longest gap between good samples that the spline crosses.
    """
    times_us, poses = np.asarray(times_us, np.int64), np.asarray(poses, np.float64)
    good = checked_samples(times_us, poses)
    if knot_us is None:
        steps = np.diff(times_us[good])
        knot_us = max(KNOT_US, int(np.median(steps)) if len(steps) else KNOT_US)
    bridged_us = max(bridged_us, 2 * knot_us)
    for _ in range(ROUNDS):
        trajectory = _fitted(times_us, poses, good, (knot_us, bridged_us))
        far = good & _far(trajectory, times_us, poses, good)
        if not far.any():
            return trajectory
        good &= ~far
    return _fitted(times_us, poses, good, (knot_us, bridged_us))


def _fitted(times_us: NDArray[np.int64], poses: F8, good: NDArray[np.bool_], spacing: tuple[int, int]) -> Trajectory:
    """A fit to the good samples; pieces of one alone are left out."""
    knot_us, bridged_us = spacing
    kept = np.flatnonzero(good)
    number = pieces_of(times_us[kept], poses[kept], bridged_us)
    lonely = np.bincount(number, minlength=1)[number] < 2 if len(kept) else np.zeros(0, np.bool_)
    kept, number = kept[~lonely], np.unique(number[~lonely], return_inverse=True)[1]
    bad = np.ones(len(times_us), np.bool_)
    bad[kept] = False
    t = times_us[kept]
    begin = np.flatnonzero(np.diff(number, prepend=-1))
    starts, stops = t[begin], t[np.append(begin[1:], len(t)) - 1] if len(t) else t
    counts = -(-(stops - starts) // knot_us) + 3
    first = np.cumsum(counts) - counts
    values = np.concatenate((poses[kept, :3, 3], _continuous(quaternions_of_matrices(poses[kept, :3, :3]))), axis=1)
    knot, weights, _ = weights_of(t - starts[number], knot_us)
    controls = fitted_controls(first[number] + knot, weights, values, counts) if len(t) else np.zeros((0, 7))
    return Trajectory(starts, stops, first, controls, knot_us, bad)


def _continuous(quaternions: F8) -> F8:
    """The same rotations, each quaternion with the sign that is near the one before."""
    same = np.einsum("nk,nk->n", quaternions[1:], quaternions[:-1]) >= 0
    return quaternions * np.cumprod(np.append(1, np.where(same, 1, -1)))[: len(quaternions), None]


def _far(trajectory: Trajectory, times_us: NDArray[np.int64], poses: F8, good: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which samples lie far from the path, for how far the others lie from it, and farther than their neighbours."""
    path = trajectory.at(times_us)
    used = good & path.valid & ~trajectory.bad
    if not used.any():
        return used
    measured = np.where(good[:, None, None], poses, path.world_from_body)
    offset = np.linalg.norm(path.world_from_body[:, :3, 3] - measured[:, :3, 3], axis=1)
    chord = np.linalg.norm(path.world_from_body[:, :3, :3] - measured[:, :3, :3], axis=(1, 2)) / np.sqrt(2)
    error = np.maximum(offset / _limit(offset[used], FAR_M), chord / _limit(chord[used], FAR_RAD))
    error = np.where(used, error, 0)
    highest = np.lib.stride_tricks.sliding_window_view(np.pad(error, NEAR), 2 * NEAR + 1).max(axis=1)
    return (error > 1) & (error == highest)


def _limit(errors: F8, least: float) -> float:
    return max(least, FAR * 1.4826 * float(np.median(errors)))


def _turning(quaternion: F8, rate: F8) -> F8:
    """Angular velocity in the body's axes, rad/s, of quaternions (M, 4) of any length and their rates."""
    length2 = np.einsum("mk,mk->m", quaternion, quaternion)[:, None]
    w, v = quaternion[:, :1], quaternion[:, 1:]
    return 2 * (w * rate[:, 1:] - v * rate[:, :1] - np.cross(v, rate[:, 1:])) / length2
