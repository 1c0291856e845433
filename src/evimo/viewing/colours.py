"""The palette: RGB, made for a dark background and readable with any colour vision."""

import cv2
import numpy as np
from numpy.typing import NDArray

RGB = tuple[int, int, int]
Image = NDArray[np.uint8]
"""(H, W, 3) uint8 RGB."""

BACKDROP: RGB = (11, 13, 17)
CARD: RGB = (22, 25, 31)
RULE: RGB = (62, 68, 80)
INK: RGB = (236, 239, 243)
MUTED: RGB = (158, 166, 178)
DARK: RGB = (10, 12, 15)

POSITIVE: RGB = (255, 104, 82)
NEGATIVE: RGB = (76, 160, 255)
MOVING_WITHOUT_ID: RGB = (150, 150, 150)

X_AXIS: RGB = (245, 166, 35)
Y_AXIS: RGB = (86, 190, 245)
Z_AXIS: RGB = (240, 240, 240)

OBJECTS: tuple[RGB, ...] = (
    (240, 228, 66),
    (70, 190, 255),
    (255, 128, 64),
    (40, 210, 150),
    (255, 130, 190),
    (150, 130, 255),
    (190, 235, 120),
    (225, 180, 140),
)
"""After Okabe and Ito (2008), lightened; neighbours differ in lightness as well as in hue."""

DEPTH_RANGE = (0.25, 4.0)
"""Nearest and farthest relative depth that the depth colours tell apart, in mean depths."""

STATIC: RGB = (150, 156, 166)
"""Static bodies that look like objects."""

_WHEEL: tuple[RGB, ...] = ((255, 150, 30), (225, 85, 170), (60, 130, 255), (30, 190, 130))
"""Colours of right, down, left, up: blue against orange, green against pink, for colour-blind eyes."""

_RESTING: RGB = (205, 208, 212)


def id_colour(object_id: int) -> RGB:
    """The colour of an object, the same in every slice; colours return after eight ids."""
    return OBJECTS[(object_id - 1) % len(OBJECTS)]


def id_table() -> Image:
    """(256, 3) uint8: `table[ids]` paints ids; the background is black."""
    return np.array([(0, 0, 0), *(id_colour(object_id) for object_id in range(1, 256))], np.uint8)


def depth_table() -> Image:
    """(256, 3) uint8 from nearest (bright) to farthest (dark), perceptually even."""
    ramp = np.arange(255, -1, -1, dtype=np.uint8)[:, None]
    return np.array(cv2.applyColorMap(ramp, cv2.COLORMAP_VIRIDIS).reshape(256, 3)[:, ::-1], np.uint8)


def depth_index(depth: NDArray[np.float32], *, bounds: tuple[float, float] = DEPTH_RANGE) -> NDArray[np.uint8]:
    """Row of `depth_table` of each depth, logarithmic between the bounds (nearest, farthest), clipped."""
    near, far = np.log(bounds)
    gain = 255 / (far - near)
    log_depth = cv2.log(np.maximum(depth, 1e-6).astype(np.float32))
    return np.clip(log_depth * gain - near * gain, 0, 255).astype(np.uint8)


def painted(indices: NDArray[np.uint8], table: Image) -> Image:
    """`table[indices]`, ten times faster; indices (H, W), table (256, 3)."""
    return np.asarray(cv2.applyColorMap(indices, table[:, None]), np.uint8)


def direction_colours(velocity: NDArray[np.float64], *, full: float) -> Image:
    """Colours of velocities in the image plane.

    Args:
        velocity: (..., 2), x to the right and y down.
        full: speed from which on the colour is pure; slower fades to grey, hardly
            so down to half of it.

    Returns:
        (..., 3) uint8 RGB.
    """
    x, y = velocity[..., 0], velocity[..., 1]
    corners = _as_lab(np.array([*_WHEEL, _WHEEL[0], _RESTING], np.uint8))
    turn = np.mod(np.arctan2(y, x), 2 * np.pi) * (2 / np.pi)
    quarter = np.minimum(turn.astype(int), 3)
    between = (turn - quarter)[..., None]
    pure = corners[quarter] * (1 - between) + corners[quarter + 1] * between
    strength = 1 - np.square(1 - np.minimum(np.hypot(x, y) / full, 1))[..., None]
    return _as_rgb(corners[-1] * (1 - strength) + pure * strength)


def _as_lab(rgb: Image) -> NDArray[np.float32]:
    flat = rgb.reshape(1, -1, 3).astype(np.float32) / 255
    return np.asarray(cv2.cvtColor(flat, cv2.COLOR_RGB2LAB), np.float32).reshape(rgb.shape)


def _as_rgb(lab: NDArray[np.float64]) -> Image:
    rgb = cv2.cvtColor(lab.reshape(1, -1, 3).astype(np.float32), cv2.COLOR_LAB2RGB)
    return np.rint(np.clip(rgb, 0, 1) * 255).astype(np.uint8).reshape(lab.shape)
