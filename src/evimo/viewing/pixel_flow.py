"""Motion on the plane Z = 1 as motion of pixels, lens included."""

import numpy as np
from numpy.typing import NDArray

from evimo.geometry.camera import Camera

STEP = 1e-4
"""On Z = 1, for differences: about 0.02 px of a usual camera."""


class PixelFlow:
    """The lens map's Jacobian at every pixel of a camera, made once.

    grid: (2, H, W), x and y of each pixel on the plane Z = 1; 0 where the lens gives none.
    """

    def __init__(self, camera: Camera) -> None:
        straight, valid = camera.normalised(camera.pixels())
        straight = np.where(valid[..., None], straight, 0)
        self.grid = np.moveaxis(straight, -1, 0)
        steps = np.array([(STEP, 0.0), (0.0, STEP)])
        self._jacobian = [(camera.project(straight + step) - camera.project(straight - step)) / 2 for step in steps]

    def px(self, flow: NDArray[np.float64]) -> NDArray[np.float64]:
        """Image velocity (2, H, W) on the plane Z = 1, in 1/s, as (H, W, 2) in px/s on the sensor."""
        along_x, along_y = self._jacobian
        return (flow[0, ..., None] * along_x + flow[1, ..., None] * along_y) / STEP
