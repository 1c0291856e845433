"""Rigid motions between point sets, and poses as tangents that an optimiser can move."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

F8 = NDArray[np.float64]


def fit_rigid(to: F8, source: F8) -> F8:
    """The rigid motion (..., 4, 4) that brings source points (..., N, 3) closest to others (..., N, 3), least squares.

    A proper rotation always, no mirror image, even where all points lie in a plane (Kabsch, Umeyama).
    """
    to_mean, source_mean = to.mean(-2, keepdims=True), source.mean(-2, keepdims=True)
    turn = nearest_rotation(np.swapaxes(to - to_mean, -1, -2) @ (source - source_mean))
    return pose(turn, (to_mean - source_mean @ np.swapaxes(turn, -1, -2))[..., 0, :])


def nearest_rotation(matrix: F8) -> F8:
    """The proper rotations (..., 3, 3) most like matrices (..., 3, 3)."""
    left, _, right = np.linalg.svd(matrix)
    sign = np.ones(left.shape[:-1])
    sign[..., 2] = np.sign(np.linalg.det(left @ right))
    return (left * sign[..., None, :]) @ right


def pose(turn: F8, place: F8) -> F8:
    """Rotations (..., 3, 3) and translations (..., 3) as matrices (..., 4, 4)."""
    made = np.zeros((*turn.shape[:-2], 4, 4))
    made[..., :3, :3], made[..., :3, 3], made[..., 3, 3] = turn, place, 1
    return made


def moved(a_from_b: F8, points: F8) -> F8:
    """Points (..., N, 3) of b in the coordinates of a."""
    return points @ np.swapaxes(a_from_b[..., :3, :3], -1, -2) + a_from_b[..., None, :3, 3]


def inverse(a_from_b: F8) -> F8:
    """The poses `b_from_a` (..., 4, 4)."""
    turn = np.swapaxes(a_from_b[..., :3, :3], -1, -2)
    return pose(turn, -(turn @ a_from_b[..., :3, 3:])[..., 0])


def nudged(a_from_b: F8, step: F8) -> F8:
    """A pose (4, 4) after a step (6,): its translation moved by three metres, its axes turned by a rotation vector."""
    turn = a_from_b[:3, :3] @ Rotation.from_rotvec(step[3:]).as_matrix()
    return pose(turn, a_from_b[:3, 3] + step[:3])


def angle_between(one: F8, other: F8) -> F8:
    """The angle between the rotations of two poses (..., 4, 4), rad."""
    turn = np.swapaxes(one[..., :3, :3], -1, -2) @ other[..., :3, :3]
    return np.asarray(Rotation.from_matrix(turn).magnitude(), np.float64)
