# pyright: basic
"""The way back: maps of the rectified image to the pixels of the sensor, one compiled pass for all maps."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.compiling import njit
from evimo.geometry.rectification import Rectification

F4 = NDArray[np.float32]


class ToSensor:
    """Brings maps of a rectified image to the sensor's pixels; made once per camera.

    The maps may be `step` times coarser than the image and may reach beyond it to the right and below. Results are
    meaningful where the rectification is `valid`.
    """

    def __init__(self, rectification: Rectification, *, step: int = 1) -> None:
        height, width = rectification.image.size
        self._x, self._y = (
            ((np.clip(at, 0, last) + 0.5) / step - 0.5).astype(np.float32)
            for at, last in ((rectification.x, width - 1), (rectification.y, height - 1))
        )
        self._row, self._column = (np.floor(at + 0.5).astype(np.intp) for at in (self._y, self._x))

    def bilinear(self, maps: NDArray[Any]) -> F4:
        """Maps (..., h, w) to (..., H, W) float32; border pixels reach half a pixel outwards."""
        flat = np.ascontiguousarray(maps, np.float32).reshape(-1, *maps.shape[-2:])
        return read_bilinear(flat, self._x, self._y).reshape(*maps.shape[:-2], *self._x.shape)

    def nearest(self, labels: NDArray[Any]) -> NDArray[Any]:
        """Labels (h, w) to (H, W)."""
        return labels[self._row, self._column]


@njit(nogil=True, fastmath=True)
def read_bilinear(maps, x, y):
    """Maps (C, h, w) float32 read at column x and row y, both (H, W) float32 px; (C, H, W). Outside is the border."""
    count, height, width = maps.shape
    result = np.empty((count, *x.shape), np.float32)
    first, below = np.empty(x.shape[1], np.int64), np.empty(x.shape[1], np.int64)
    share, down = np.empty(x.shape[1], np.float32), np.empty(x.shape[1], np.float32)
    beside = 1 if width > 1 else 0
    for row in range(x.shape[0]):
        for k in range(x.shape[1]):
            at_x = min(max(x[row, k], np.float32(0)), np.float32(width - 1))
            at_y = min(max(y[row, k], np.float32(0)), np.float32(height - 1))
            column, line = min(int(at_x), max(width - 2, 0)), min(int(at_y), max(height - 2, 0))
            share[k], down[k] = at_x - np.float32(column), at_y - np.float32(line)
            first[k] = line * width + column
            below[k] = first[k] + (width if height > 1 else 0)
        for c in range(count):
            flat, target = maps[c].reshape(-1), result[c, row]
            for k in range(x.shape[1]):
                top, bottom = first[k], below[k]
                upper = flat[top] + share[k] * (flat[top + beside] - flat[top])
                lower = flat[bottom] + share[k] * (flat[bottom + beside] - flat[bottom])
                target[k] = upper + down[k] * (lower - upper)
    return result
