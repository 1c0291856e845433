"""Maps of depth as points in space, the lens taken out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.geometry.camera import Camera

F4 = NDArray[np.float32]
MOST = 6_000  # points of one slice: a frustum well covered, and small files


@dataclass(frozen=True, slots=True)
class Cloud:
    """Points (N, 3) in camera axes, and the pixel of each as rows and columns (N,)."""

    points: F4
    rows: NDArray[np.intp]
    columns: NDArray[np.intp]


class Lifter:
    """Lifts a grid of a camera's pixels to the depths of a map; at most so many points."""

    def __init__(self, camera: Camera, *, most: int = MOST) -> None:
        step = max(1, int(np.ceil(np.sqrt(camera.height * camera.width / most))))
        rows, columns = np.mgrid[step // 2 : camera.height : step, step // 2 : camera.width : step]
        self._rows, self._columns = rows.ravel(), columns.ravel()
        at = np.stack((self._columns, self._rows), axis=-1)
        xy, self._sees = camera.normalised(at.astype(np.float64))
        self._rays = np.concatenate((xy, np.ones((len(xy), 1))), axis=1)

    def cloud(self, depth: NDArray[np.floating], known: NDArray[np.bool_]) -> Cloud:
        """The points of the pixels whose depth is known; both maps are (H, W), depth along the optical axis."""
        z = depth[self._rows, self._columns].astype(np.float64)
        kept = known[self._rows, self._columns] & self._sees & np.isfinite(z) & (z > 0)
        points = self._rays[kept] * z[kept, None]
        return Cloud(points.astype(np.float32), self._rows[kept], self._columns[kept])


def moved(points: NDArray[np.floating], world_from_cam: NDArray[np.float64]) -> F4:
    """Points (N, 3) in world axes."""
    return (points @ world_from_cam[:3, :3].T + world_from_cam[:3, 3]).astype(np.float32)
