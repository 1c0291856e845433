"""A camera: pinhole or fisheye, with its lens, as NumPy maps between pixels and the plane Z = 1."""

import math
import warnings
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from evimo.arguments import number_of, size_of
from evimo.errors import BadInput, EvimoWarning

Lens = Literal["radtan", "fisheye"]
F8 = NDArray[np.float64]

COEFFICIENTS = {"radtan": (0, 4, 5), "fisheye": (0, 4)}
WIDEST = math.radians(89)  # of a fisheye: at 90 degrees a ray no longer meets the plane Z = 1
SETTLED_PX = 1e-6  # the inverse lens map counts as found where going forward again comes this close
NEGLIGIBLE = 1e-12  # a lens coefficient that moves nothing this side of 89 degrees; its inverse would overflow
ASSUMED_FOCAL = 0.75  # in widths: near the middle of the event cameras with published calibration


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera has a sensor, intrinsics and a lens, and maps between its pixels and directions.

    Convention: x is the column, y the row, and integer pixel coordinates are pixel centres. Camera axes are x right,
    y down, z forward.

    fx, fy:        focal lengths, px.
    cx, cy:        principal point, px; column and row.
    height, width: of the sensor, px.
    distortion:    `radtan`: k1 k2 p1 p2 and maybe k3 (OpenCV's order); `fisheye`: k1 k2 k3 k4 (OpenCV's, kalibr's
                   `equidistant`). Empty: a `radtan` camera is a pinhole, a `fisheye` one is exactly equidistant.
    lens:          which of the two models.

    Raises:
        BadInput: a focal length or size is not positive, a number not finite, or the count of coefficients is wrong.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    height: int
    width: int
    distortion: tuple[float, ...] = ()
    lens: Lens = "radtan"

    def __post_init__(self) -> None:
        self._take_plain_numbers()
        numbers = (self.fx, self.fy, self.cx, self.cy, *self.distortion)
        if not all(math.isfinite(number) for number in numbers) or min(self.fx, self.fy) <= 0:
            raise BadInput(f"not a camera: {numbers}", fix="finite numbers and positive focal lengths in px")
        if self.lens not in COEFFICIENTS or len(self.distortion) not in COEFFICIENTS[self.lens]:
            raise BadInput(
                f"a {self.lens} lens with {len(self.distortion)} coefficients",
                fix="radtan with k1 k2 p1 p2 and maybe k3, or fisheye with k1 k2 k3 k4",
            )

    def _take_plain_numbers(self) -> None:
        """Make plain numbers and a tuple of what may be NumPy's or a list, so that cameras compare and print alike."""
        for name in ("fx", "fy", "cx", "cy"):
            number = number_of(getattr(self, name), f"{name} of the camera", fix="a number in px")
            object.__setattr__(self, name, number)
        height, width = size_of(self.size, "the size of the camera's sensor")
        object.__setattr__(self, "height", height)
        object.__setattr__(self, "width", width)
        try:
            coefficients = tuple(float(each) for each in self.distortion)
        except (TypeError, ValueError):
            raise BadInput(f"not coefficients of a lens: {self.distortion!r}", fix="numbers, or () for none") from None
        object.__setattr__(self, "distortion", coefficients)

    @property
    def size(self) -> tuple[int, int]:
        """Height and width, px."""
        return self.height, self.width

    @property
    def is_pinhole(self) -> bool:
        """Whether straight lines stay straight: no lens, or one with zeros only."""
        return self.lens == "radtan" and not any(self.distortion)

    def pixels(self) -> F8:
        """Every pixel centre of the sensor, (H, W, 2), px; [..., 0] is the column."""
        x, y = np.meshgrid(np.arange(self.width), np.arange(self.height))
        return np.stack((x, y), axis=-1).astype(np.float64)

    def project(self, xy: F8) -> F8:
        """Points (..., 2) of the plane Z = 1 to pixels (..., 2). Meaningful where `sees` is true."""
        return self._bent(np.asarray(xy, np.float64)) * (self.fx, self.fy) + (self.cx, self.cy)

    def sees(self, xy: F8) -> NDArray[np.bool_]:
        """Where points (..., 2) of the plane Z = 1 lie within the part of the lens model that can be inverted: (...).

        A polynomial fitted to calibration points turns back outside them: beyond that radius two directions share a
        pixel. The model holds only up to there. Says nothing about the borders of the sensor.
        """
        radius = np.linalg.norm(np.asarray(xy, np.float64), axis=-1)
        return np.asarray((np.arctan(radius) if self.lens == "fisheye" else radius) < self._turning_point())

    def normalised(self, px: F8) -> tuple[F8, NDArray[np.bool_]]:
        """Pixels (..., 2) to points (..., 2) of the plane Z = 1, the lens taken out.

        Returns:
            The points, and `valid` (...): false where the lens model gives no direction for a pixel (`sees`); such
            points are finite and mean nothing.
        """
        at = (np.asarray(px, np.float64) - (self.cx, self.cy)) / (self.fx, self.fy)
        if self.is_pinhole:
            return at, np.ones(at.shape[:-1], np.bool_)
        bent = at.reshape(-1, 2)
        xy = self._straightened_radius(bent)
        if self.lens == "radtan":
            xy = self._newton(xy, bent)
        miss = np.abs(self._bent(xy) - bent).max(axis=-1) * max(self.fx, self.fy)
        valid = self.sees(xy) & (miss < SETTLED_PX)
        return xy.reshape(at.shape), valid.reshape(at.shape[:-1])

    def resized(self, height: int, width: int) -> "Camera":
        """The same camera after its image is resized: scale by the true ratio of sizes, centres at c → s(c + ½) − ½."""
        sx, sy = width / self.width, height / self.height
        return replace(
            self,
            fx=self.fx * sx,
            fy=self.fy * sy,
            cx=sx * (self.cx + 0.5) - 0.5,
            cy=sy * (self.cy + 0.5) - 0.5,
            height=height,
            width=width,
        )

    def _radial(self) -> F8:
        """Coefficients of 1, q, q², … in (bent radius / straight radius), q the squared radius or angle."""
        k = (*self.distortion, 0.0, 0.0, 0.0, 0.0, 0.0)
        return np.array((1.0, *k[:4]) if self.lens == "fisheye" else (1.0, k[0], k[1], k[4]))

    def _turning_point(self) -> float:
        """The straight radius (fisheye: angle) where the bent radius stops growing; infinite if it never does."""
        slope = _slope(self._radial())
        slope = np.trim_zeros(np.where(np.abs(slope) > NEGLIGIBLE, slope, 0), "b")
        roots = np.asarray(np.roots(slope[::-1]), np.complex128)
        turns = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0)]
        first = math.sqrt(float(turns.min())) if len(turns) else math.inf
        return min(first, WIDEST) if self.lens == "fisheye" else first

    def _bent(self, xy: F8) -> F8:
        """The lens: straight to distorted coordinates on Z = 1 (OpenCV's `projectPoints`, `fisheye.projectPoints`)."""
        squared = (xy**2).sum(axis=-1, keepdims=True)
        if self.lens == "fisheye":
            radius = np.sqrt(squared)
            angle = np.arctan(radius)
            return xy * _ratio(angle * _series(self._radial(), angle**2), radius)
        bent = xy * _series(self._radial(), squared)
        if not any(self.distortion[2:4]):
            return bent
        p1, p2 = self.distortion[2:4]
        product = 2 * xy[..., :1] * xy[..., 1:]
        return bent + product * (p1, p2) + (squared + 2 * xy**2) * (p2, p1)

    def _straightened_radius(self, bent: F8) -> F8:
        """Invert the radial part alone: a table of the rising branch, then Newton's method in one dimension."""
        radial, bent_radius = self._radial(), np.linalg.norm(bent, axis=-1, keepdims=True)
        end = self._turning_point()
        if not math.isfinite(end):  # a rising polynomial without end: go as far as the widest pixel needs
            end, widest = 1.0, float(bent_radius.max(initial=0))
            while end * float(_series(radial, np.array([end**2]))[0]) < widest:
                end *= 2
        steps = np.linspace(0, end, 4096)
        radius = np.asarray(np.interp(bent_radius, steps * _series(radial, steps**2), steps), np.float64)
        for _ in range(4):
            slope = _series(_slope(radial), radius**2)
            step = (radius * _series(radial, radius**2) - bent_radius) / np.where(slope > 1e-9, slope, np.inf)
            radius = np.minimum(np.maximum(radius - step, 0), end)
        return bent * _ratio(np.tan(radius) if self.lens == "fisheye" else radius, bent_radius)

    def _newton(self, xy: F8, bent: F8) -> F8:
        """Add the tangential part: Newton's method in two dimensions, kept on the rising branch."""
        if not any(self.distortion[2:4]):
            return xy
        radial, (p1, p2), end = self._radial(), self.distortion[2:4], self._turning_point()
        change_of = radial[1:] * np.arange(1, len(radial))  # the derivative after the squared radius
        for _ in range(20):
            x, y = xy[..., 0], xy[..., 1]
            squared = x * x + y * y
            scale, change = _series(radial, squared), 2 * _series(change_of, squared)
            across = change * x * y + 2 * p1 * x + 2 * p2 * y  # d(bent x)/dy = d(bent y)/dx
            along_x = scale + change * x * x + 2 * p1 * y + 6 * p2 * x
            along_y = scale + change * y * y + 6 * p1 * y + 2 * p2 * x
            area = along_x * along_y - across * across
            area = np.where(np.abs(area) > 1e-9, area, np.inf)
            miss = self._bent(xy) - bent
            step_x = (along_y * miss[..., 0] - across * miss[..., 1]) / area
            step_y = (along_x * miss[..., 1] - across * miss[..., 0]) / area
            step = np.clip(np.stack((step_x, step_y), axis=-1), -0.1, 0.1)
            xy = xy - step
            radius = np.linalg.norm(xy, axis=-1, keepdims=True)
            xy = xy * np.minimum(1, end / np.maximum(radius, 1e-12))
            if np.abs(step).max(initial=0) < 1e-13:
                break
        return xy


def assumed_camera(size: tuple[int, int]) -> Camera:
    """A camera for a sensor (height, width) whose calibration nobody gave: f = 0.75 width, centred, no lens; warns."""
    height, width = size
    warnings.warn(
        f"no calibration: assuming f = {ASSUMED_FOCAL} x width = {ASSUMED_FOCAL * width:g} px, centred, no lens; "
        "directions, depth and velocities are as wrong as that guess",
        EvimoWarning,
        stacklevel=2,
    )
    focal_px = ASSUMED_FOCAL * width
    return Camera(focal_px, focal_px, (width - 1) / 2, (height - 1) / 2, height, width)


def _series(coefficients: F8, at: F8) -> F8:
    """c0 + c1 at + c2 at² + …, by Horner's rule."""
    total = np.zeros_like(at)
    for coefficient in coefficients[::-1]:
        total = total * at + coefficient
    return total


def _slope(radial: F8) -> F8:
    """Derivative after r of r (c0 + c1 r² + c2 r⁴ + …), as coefficients of 1, r², r⁴, …"""
    return radial * (2 * np.arange(len(radial)) + 1)


def _ratio(above: F8, below: F8) -> F8:
    """Quotient of two radii; 1 in the middle of the image, where both are 0."""
    return np.divide(above, below, out=np.ones_like(above), where=below > 0)
