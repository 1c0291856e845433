"""The rectified image: a small pinhole image that events go into and results come out of, for any sensor and lens."""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadInput, EvimoWarning
from evimo.geometry.camera import Camera

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
Mask = NDArray[np.bool_]

MAX_SIZE = (260, 346)
COVERED = 0.95  # share of the sensor's usable pixels that the rectified image must hold
FAR_PX = 30_000.0  # positions outside the image are kept within this, so that they stay numbers


@dataclass(frozen=True, slots=True)
class Rectification:
    """Both ways between the pixels (H, W) of a sensor and those (h, w) of its rectified image.

    Convention: integer coordinates are pixel centres; a pixel reaches half a pixel to each side, so that a position is
    inside an image for −½ ≤ x < width − ½. Made by `rectified`, once per camera.

    camera:      the sensor with its lens.
    image:       the rectified image, a pinhole.
    x, y:        column and row in the rectified image of each sensor pixel, (H, W) float32.
    valid:       sensor pixels that have a place in the rectified image, (H, W).
    image_valid: rectified pixels that have a sensor counterpart, (h, w).
    source:      index of that counterpart, the nearest pixel, into the flattened sensor, (h, w); 0 where there is none.
    folded:      count of sensor pixels where the lens model is not monotonic, so that they have no direction.
    outside:     count of sensor pixels with a direction, but outside the rectified image.
    """

    camera: Camera
    image: Camera
    x: F4
    y: F4
    valid: Mask
    image_valid: Mask
    source: NDArray[np.intp]
    folded: int
    outside: int

    @property
    def invalid(self) -> int:
        """Count of sensor pixels without a place in the rectified image."""
        return self.folded + self.outside

    def warn_of_invalid(self) -> None:
        """Say once how many sensor pixels are left out, if any. For the caller that made the rectification."""
        if not self.invalid:
            return
        total = self.valid.size
        causes = [
            f"{count} ({count / total:.1%}) {why}"
            for count, why in (
                (self.folded, "where the lens calibration does not hold (not monotonic)"),
                (self.outside, "outside the rectified image"),
            )
            if count
        ]
        warnings.warn(
            f"{self.invalid} of {total} sensor pixels are left out: {' and '.join(causes)}; "
            "their events are dropped and results there are not valid",
            EvimoWarning,
            stacklevel=2,
        )

    def from_sensor(self, on_sensor: NDArray[Any]) -> NDArray[Any]:
        """Bring truth (..., H, W) from sensor pixels to the rectified image (..., h, w): nearest pixel, type kept.

        Zero where not `image_valid`.
        """
        flat = on_sensor.reshape(*on_sensor.shape[:-2], -1)
        return np.where(self.image_valid, flat[..., self.source], np.zeros((), on_sensor.dtype))


def rectified(camera: Camera, *, max_size: tuple[int, int] = MAX_SIZE) -> Rectification:
    """The rectified image of a camera, at most `max_size` (height, width) and never enlarged.

    Its size is the sensor's times s = min(1, max_size / size), its principal point moves by the half-pixel rule. With
    a lens, its pixels are square and its focal length is the largest, at most s·min(fx, fy), with at least 95 % of the
    sensor's usable pixels inside. Without a lens it is the sensor's image made smaller by s, the very same for s = 1.

    Raises:
        BadInput: the lens model gives no direction for any pixel, or the principal point of a lens is off the sensor.
    """
    scale = min(1.0, max_size[0] / camera.height, max_size[1] / camera.width)
    height, width = max(1, round(scale * camera.height)), max(1, round(scale * camera.width))
    cx, cy = scale * (camera.cx + 0.5) - 0.5, scale * (camera.cy + 0.5) - 0.5
    xy, has_direction = camera.normalised(camera.pixels())
    if camera.is_pinhole:
        image = Camera(scale * camera.fx, scale * camera.fy, cx, cy, height, width)
        at = scale * (camera.pixels() + 0.5) - 0.5  # not through fx and back: integers stay integers
    else:
        frame = Camera(scale * min(camera.fx, camera.fy), scale * min(camera.fx, camera.fy), cx, cy, height, width)
        image = _zoomed_out(frame, xy[has_direction])
        at = np.clip(image.project(xy), -FAR_PX, FAR_PX)
    at = at.astype(np.float32)  # before asking what is inside: rounding must not carry a position across the border
    valid = has_direction & _inside(at, image.size)
    source, image_valid = _counterparts(camera, image, has_direction)
    return Rectification(
        camera=camera,
        image=image,
        x=np.ascontiguousarray(at[..., 0]),
        y=np.ascontiguousarray(at[..., 1]),
        valid=valid,
        image_valid=image_valid,
        source=source,
        folded=int((~has_direction).sum()),
        outside=int((has_direction & ~valid).sum()),
    )


def halved_mask(mask: Mask, size: tuple[int, int]) -> F4:
    """Return the share of each pixel's four that a mask (H, W) holds, (h, w) of half of `size`; beyond is nothing."""
    whole = np.zeros(size, np.float32)
    whole[: mask.shape[0], : mask.shape[1]] = mask
    return whole.reshape(size[0] // 2, 2, size[1] // 2, 2).mean((1, 3))


def _inside(at: F4 | F8, size: tuple[int, int]) -> Mask:
    """Where positions (..., 2) lie within the pixels of an image (height, width)."""
    x, y = at[..., 0], at[..., 1]
    return (x >= -0.5) & (x < size[1] - 0.5) & (y >= -0.5) & (y < size[0] - 0.5)


def _zoomed_out(frame: Camera, xy: F8) -> Camera:
    """The frame with the largest focal length, at most its own, that holds 95 % of the points (N, 2) on Z = 1."""
    if not len(xy):
        raise BadInput(
            "the lens calibration gives no direction for any pixel", fix="check units and order of its numbers"
        )
    reach_right, reach_left = frame.width - 0.5 - frame.cx, frame.cx + 0.5
    reach_down, reach_up = frame.height - 0.5 - frame.cy, frame.cy + 0.5
    if min(reach_right, reach_left, reach_down, reach_up) <= 0:
        raise BadInput(
            f"the principal point ({frame.cx:g}, {frame.cy:g}) lies off the image", fix="check the calibration's size"
        )
    x, y = xy[:, 0], xy[:, 1]
    tightest = np.maximum.reduce((x / reach_right, -x / reach_left, y / reach_down, -y / reach_up))
    kept = int(np.ceil(COVERED * len(xy))) - 1
    needed = float(np.partition(tightest, kept)[kept]) * (1 + 1e-6)  # the last one kept: inside, not on the border
    focal_px = frame.fx if needed * frame.fx <= 1 else 1 / needed
    return Camera(focal_px, focal_px, frame.cx, frame.cy, frame.height, frame.width)


def _counterparts(camera: Camera, image: Camera, has_direction: Mask) -> tuple[NDArray[np.intp], Mask]:
    """For each rectified pixel the index of the sensor pixel that sees the same direction, and whether there is one."""
    if camera.is_pinhole:
        scale = image.fx / camera.fx
        on_sensor = (image.pixels() + 0.5) / scale - 0.5
        exists = _inside(on_sensor, camera.size)
    else:
        xy, _ = image.normalised(image.pixels())
        on_sensor = camera.project(xy)
        exists = camera.sees(xy) & _inside(on_sensor, camera.size)
    column, row = np.floor(np.where(exists[..., None], on_sensor, 0) + 0.5).astype(np.intp).transpose(2, 0, 1)
    exists &= has_direction[row, column]
    return np.where(exists, row * camera.width + column, 0), exists
