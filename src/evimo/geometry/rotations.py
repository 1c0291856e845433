"""Rotations in the forms that files hold, in NumPy: quaternions and fixed-axis angles to matrices and back.

Quaternions are (w, x, y, z), the real part first. Fixed-axis angles (roll, pitch, yaw) turn about x, then y, then z.
"""

import numpy as np
from numpy.typing import NDArray

F8 = NDArray[np.float64]


def matrices_of_quaternions(quaternions: F8) -> F8:
    """Return the rotation matrices (..., 3, 3) of quaternions (..., 4) of any length but zero, which gives NaN."""
    with np.errstate(invalid="ignore", divide="ignore"):
        unit = quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True)
    w, x, y, z = np.moveaxis(unit, -1, 0)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternions_of_matrices(matrices: F8) -> F8:
    """Return unit quaternions (..., 4) of rotation matrices (..., 3, 3), either sign.

    Each is taken from its largest component, which is well-conditioned at every angle.
    """
    m = matrices
    diagonal = np.moveaxis(np.diagonal(m, axis1=-2, axis2=-1), -1, 0)
    xx, yy, zz = diagonal
    zy, xz, yx = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    xy, xz_, yz = m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1]
    rows = (
        (1 + xx + yy + zz, zy, xz, yx),
        (zy, 1 + xx - yy - zz, xy, xz_),
        (xz, xy, 1 - xx + yy - zz, yz),
        (yx, xz_, yz, 1 - xx - yy + zz),
    )  # 4 q qᵀ: each row is the quaternion times four of its components
    outer = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    largest = np.diagonal(outer, axis1=-2, axis2=-1).argmax(axis=-1)
    row = np.take_along_axis(outer, largest[..., None, None], axis=-2)[..., 0, :]
    return row / np.linalg.norm(row, axis=-1, keepdims=True)


def matrices_of_angles(angles: F8) -> F8:
    """Return the rotation matrices (..., 3, 3) of fixed-axis angles (..., 3), rad."""
    (cr, cp, cy), (sr, sp, sy) = np.moveaxis(np.cos(angles), -1, 0), np.moveaxis(np.sin(angles), -1, 0)
    rows = (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def angles_of_matrices(matrices: F8) -> F8:
    """Return fixed-axis angles (..., 3) of rotation matrices, rad; the pitch is within ±π/2."""
    roll = np.arctan2(matrices[..., 2, 1], matrices[..., 2, 2])
    pitch = np.arctan2(-matrices[..., 2, 0], np.hypot(matrices[..., 2, 1], matrices[..., 2, 2]))
    yaw = np.arctan2(matrices[..., 1, 0], matrices[..., 0, 0])
    return np.stack((roll, pitch, yaw), axis=-1)


def poses_of(translations: F8, rotations: F8) -> F8:
    """Return poses (..., 4, 4) of translations (..., 3) and rotation matrices (..., 3, 3)."""
    poses = np.zeros((*translations.shape[:-1], 4, 4))
    poses[..., :3, :3], poses[..., :3, 3], poses[..., 3, 3] = rotations, translations, 1
    return poses


def inverse_poses(poses: F8) -> F8:
    """Return the inverses of rigid motions (..., 4, 4)."""
    turned = np.swapaxes(poses[..., :3, :3], -1, -2)
    return poses_of(-(turned @ poses[..., :3, 3:])[..., 0], turned)
