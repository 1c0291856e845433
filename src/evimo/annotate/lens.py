"""A camera's lens as arrays for the kernels: the ray of every pixel, and how large things become in the image."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.geometry.camera import Camera

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]

SEGMENT_PX = 8.0  # of a straight line in space, whose image is looked at
SAFETY = 1.5
LANES = 16  # pixels that are asked at once, some beyond the last; of 8 the compiler makes no vector code


class LensTables(NamedTuple):
    """What the kernels know of a camera.

    numbers:   fx fy cx cy, then k1 k2 k3 p1 p2 (radtan) or k1 k2 k3 k4 0 (fisheye).
    singles:   the same in single precision.
    fisheye:   which of the two.
    rays:      (H, W, 2) of each pixel on Z = 1; nan where the lens has none.
    ray_x, ray_y: (H * W + LANES) the same, one after the other, and nan beyond.
    bounds:    (4) least and greatest x and y of them.
    farthest2: square of the radius on Z = 1 beyond which nothing is in the image.
    bulge:     how far the middle of a line of length L px is from that of its image's ends, over L², 1/px.
    columns:   (2, W) least and greatest x in each column. rows: (2, H) of y in each row.
    """

    numbers: F8
    singles: tuple[np.float32, ...]
    fisheye: bool
    rays: F4
    ray_x: F4
    ray_y: F4
    bounds: F8
    farthest2: float
    bulge: float
    columns: F8
    rows: F8


def lens_tables(camera: Camera) -> LensTables:
    """The tables of a camera."""
    straight, known = camera.normalised(camera.pixels())
    rays = np.where(known[..., None], straight, np.nan)
    x, y = rays[..., 0], rays[..., 1]
    bounds = np.array([np.nanmin(x), np.nanmax(x), np.nanmin(y), np.nanmax(y)])
    farthest = float(np.sqrt(np.nanmax(x * x + y * y))) + 2 / min(camera.fx, camera.fy)
    k = (*camera.distortion, 0.0, 0.0, 0.0, 0.0, 0.0)
    order = (0, 1, 2, 3) if camera.lens == "fisheye" else (0, 1, 4, 2, 3)
    numbers = np.array([camera.fx, camera.fy, camera.cx, camera.cy, *(k[at] for at in order), 0.0][:9])
    return LensTables(
        numbers,
        tuple(numbers.astype(np.float32)),
        camera.lens == "fisheye",
        rays.astype(np.float32),
        _flat(x),
        _flat(y),
        bounds,
        farthest**2,
        _bulge(camera, rays),
        np.stack((_least(x, 0), -_least(-x, 0))),
        np.stack((_least(y, 1), -_least(-y, 1))),
    )


def _flat(values: F8) -> F4:
    """Numbers of all pixels one after the other, and nan beyond, where lanes may reach."""
    return np.append(values, np.full(LANES, np.nan)).astype(np.float32)


def _least(values: F8, axis: int) -> F8:
    """The least number along an axis; infinite where there is none."""
    return np.where(np.isnan(values), np.inf, values).min(axis=axis)


def _some(rays: F8) -> F8:
    """Rays all over the image, (N, 2)."""
    some = rays[::4, ::4].reshape(-1, 2)
    return some[np.isfinite(some).all(axis=1)]


def _bulge(camera: Camera, rays: F8) -> float:
    at, worst = _some(rays), 0.0
    for angle in np.arange(0, np.pi, np.pi / 8):
        half = 0.5 * SEGMENT_PX / camera.fx * np.array((np.cos(angle), np.sin(angle)))
        start, stop, middle = (camera.project(at + k * half) for k in (-1.0, 1.0, 0.0))
        way = stop - start
        length = np.maximum(np.linalg.norm(way, axis=1), 1e-9)
        offset = middle - (start + stop) / 2
        worst = max(worst, float((np.linalg.norm(offset, axis=1) / length**2).max()))
    return SAFETY * worst + 1e-6
