"""Outlines that a renderer draws: points in space on the border between what is near and what is behind it."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from evimo.geometry.camera import Camera

F8 = NDArray[np.float64]

JUMP = 0.03  # of the nearer inverse depth: a larger step to the next pixel may be an outline
STEEPER = 3.0  # times as large as the steps on both sides of it: on a plane, however oblique, all three are alike
NEIGHBOURS, REACH_PX = 9, 5.0  # points of an outline, its own among them, that tell which way it runs
STRAIGHT = 0.25  # their spread across, of that along it: at corners and twigs there is more
SHIFT_PX = 0.7  # from the pixels' grid to the line through the neighbours, at most


@dataclass(frozen=True, slots=True)
class Rendered:
    """What a camera sees of bodies whose shape is known.

    depth: (H, W), m. ids: (H, W), of the bodies; 0 is the room. valid: (H, W) bool, where anything is known.
    """

    depth: NDArray[np.floating]
    ids: NDArray[np.integer]
    valid: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class OutlinePoints:
    """Points on outlines.

    points: (N, 3), camera axes. px: (N, 2), their pixels. body: (N,), whose outline it is.
    outward: (N, 2), unit vectors in the image, from what is near to what is behind it.
    """

    points: F8
    px: F8
    body: NDArray[np.int64]
    outward: F8

    def where(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> "OutlinePoints":
        """Some of the points."""
        return OutlinePoints(*(getattr(self, field.name)[chosen] for field in fields(self)))


def outline_points(seen: Rendered, camera: Camera, *, margin: int) -> OutlinePoints:
    """The points between two neighbouring pixels, at the depth of the nearer one, where depth jumps.

    What is unknown lies behind everything. No points are within `margin` px of the image's border, beyond which there
    are no events.
    """
    inverse_depth = np.where(seen.valid, 1 / np.where(seen.valid, seen.depth, 1), 0)
    found = [_jumps(inverse_depth, seen.ids, axis) for axis in (0, 1)]
    px, near, body, outward = (np.concatenate(each) for each in zip(*found, strict=True))
    straight, known = camera.normalised(px)
    known &= ((px >= margin) & (px <= (camera.width - 1 - margin, camera.height - 1 - margin))).all(axis=1)
    points = np.concatenate((straight, np.ones((len(px), 1))), axis=1) / near[:, None]
    return OutlinePoints(points, px, body, outward).where(known)


def _jumps(inverse_depth: F8, ids: NDArray[np.integer], axis: int) -> tuple[F8, F8, NDArray[np.int64], F8]:
    """Pixels, inverse depth, body and outward direction of the jumps along one axis of the image."""
    image, body = np.moveaxis(inverse_depth, axis, 0), np.moveaxis(ids, axis, 0)
    before, first, last, after = image[:-3], image[1:-2], image[2:-1], image[3:]
    step = np.abs(last - first)
    beside = np.maximum(np.abs(first - before), np.abs(after - last))
    edge = (step > JUMP * np.maximum(first, last)) & (step > STEEPER * beside)
    along, across = np.nonzero(edge)
    px, outward = np.zeros((2, len(along), 2))
    px[:, 1 - axis], px[:, axis] = along + 1.5, across
    first_is_near = (first > last)[edge]
    outward[:, 1 - axis] = np.where(first_is_near, 1, -1)
    bodies = np.where(first_is_near, body[1:-2][edge], body[2:-1][edge]).astype(np.int64)
    return px, np.maximum(first, last)[edge], bodies, outward


def straightened(found: OutlinePoints, camera: Camera) -> OutlinePoints:
    """Points off the grid of pixels, on lines through their neighbours, with the lines' normals; corners are left out.

    A slanted outline is drawn in steps, whose sides all point along the image's axes.
    """
    if len(found.px) < NEIGHBOURS:
        return found.where(np.zeros(len(found.px), np.bool_))
    distance, beside = KDTree(found.px).query(found.px, k=NEIGHBOURS, distance_upper_bound=REACH_PX)
    near = np.isfinite(distance)
    beside = np.where(near, beside, np.arange(len(found.px))[:, None])
    middle = found.px[beside].mean(axis=1)
    _, spread, ways = np.linalg.svd(found.px[beside] - middle[:, None])
    side = found.outward[beside].mean(axis=1)
    normal = ways[:, 1] * np.sign((ways[:, 1] * side).sum(axis=1))[:, None]
    clear = (spread[:, 1] < STRAIGHT * spread[:, 0]) & (near.sum(axis=1) > NEIGHBOURS // 2 + 1)
    clear &= (normal * side).sum(axis=1) > 0.4  # else it is the outline of two things
    shift = ((middle - found.px) * normal).sum(axis=1)
    px = found.px + normal * np.where(np.abs(shift) < SHIFT_PX, shift, 0)[:, None]
    straight, known = camera.normalised(px)
    points = np.concatenate((straight, np.ones((len(px), 1))), axis=1) * found.points[:, 2:]
    return OutlinePoints(points, px, found.body, normal).where(clear & known)
