"""Outlines that a renderer draws: points in space on the border between what is near and what is behind it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.geometry.camera import Camera

F8 = NDArray[np.float64]

JUMP = 0.03  # of the depth: a larger step to the neighbouring pixel is an outline, a smaller one a slope


@dataclass(frozen=True, slots=True)
class Rendered:
    """What a camera sees of bodies whose shape is known.

    depth: (H, W), m. ids: (H, W), of the bodies; 0 is the room. valid: (H, W) bool, where anything is known.
    """

    depth: NDArray[np.floating]
    ids: NDArray[np.integer]
    valid: NDArray[np.bool_]


def outline_points(seen: Rendered, camera: Camera, *, margin: int) -> tuple[F8, F8, NDArray[np.int64]]:
    """Points (N, 3) in camera axes on the outlines of what was rendered, their pixels (N, 2), and their bodies (N,).

    An outline runs between two pixels; its points lie halfway, at the depth of the nearer one. None are within so many
    px of the image's border, beyond which there are no events.
    """
    depth = np.where(seen.valid, seen.depth, np.inf)
    places: list[F8] = []
    depths: list[F8] = []
    bodies: list[NDArray[np.int64]] = []
    for axis in (0, 1):
        first, last = (np.take(depth, at, axis) for at in _neighbours(depth.shape[axis]))
        ids, other = (np.take(seen.ids, at, axis) for at in _neighbours(depth.shape[axis]))
        near = np.minimum(first, last)
        edge = np.isfinite(near) & (np.maximum(first, last) > near * (1 + JUMP))
        rows, columns = np.nonzero(edge)
        at = np.stack((columns, rows), axis=1).astype(np.float64)
        at[:, 1 - axis] += 0.5
        places.append(at)
        depths.append(near[edge])
        bodies.append(np.where(first <= last, ids, other)[edge].astype(np.int64))
    px, far, body = np.concatenate(places), np.concatenate(depths), np.concatenate(bodies)
    straight, known = camera.normalised(px)
    known &= ((px >= margin) & (px <= (camera.width - 1 - margin, camera.height - 1 - margin))).all(axis=1)
    points = np.concatenate((straight, np.ones((len(px), 1))), axis=1) * far[:, None]
    return points[known], px[known], body[known]


def _neighbours(count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    return np.arange(count - 1), np.arange(1, count)
