"""Dense image motion that follows from truth: depth, ids and twists say all."""

import numpy as np
from numpy.typing import NDArray

from evimo.recordings.truth import ObjectTruth, Truth

F8 = NDArray[np.float64]


def true_flow(truth: Truth, grid: F8) -> F8:
    """Image velocity (2, H, W) on the plane Z = 1, in 1/s; zero where depth is unknown.

    A moving object's points move with its velocity and turn about its position, relative to the world; everything
    moves against the camera (paper, eq. 1).

    Args:
        grid: (2, H, W), x and y of each pixel on the plane Z = 1, the lens taken out.
    """
    flow = point_flow(grid.reshape(2, -1), truth.depth.ravel(), truth.ids.ravel(), (truth.ego, truth.objects))
    return np.where(truth.valid, flow.reshape(grid.shape), 0)


def point_flow(
    grid: F8, depth: NDArray[np.float32], ids: NDArray[np.uint8], motion: tuple[F8, dict[int, ObjectTruth]]
) -> F8:
    """The same for points: grid (2, N), depth (N,) and ids (N,); motion: ego and objects as in `Truth`."""
    ego, objects = motion
    z = np.where(depth > 0, depth, 1).astype(np.float64)
    points = np.stack((grid[0] * z, grid[1] * z, z), axis=1)
    rate = -ego[:3] - np.cross(ego[3:], points)
    for id_, moved in objects.items():
        mine = ids == id_
        rate[mine] += moved.velocity + np.cross(moved.rotation, points[mine] - moved.position)
    return np.where(depth > 0, (rate[:, :2].T - grid * rate[:, 2]) / z, 0)
