"""What detection rates and hulls are made of: boxes, regions, and the shapes that clusters of events span."""

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.evaluation.metrics import Mask

Box = tuple[int, int, int, int]
"""x0, y0, x1, y1 in px, the last column and row included."""


def boxes_of(labels: NDArray[np.int32]) -> list[Box]:
    """The bounding boxes of the objects in a map of labels (H, W), 0 being none."""
    rows, columns = np.nonzero(labels)
    if not len(rows):
        return []
    order = np.argsort(labels[rows, columns], kind="stable")
    rows, columns = rows[order], columns[order]
    starts = np.flatnonzero(np.diff(labels[rows, columns], prepend=0))
    ends = (least.reduceat(each, starts) for least in (np.minimum, np.maximum) for each in (columns, rows))
    x0, y0, x1, y1 = (each.tolist() for each in ends)
    return list(zip(x0, y0, x1, y1, strict=True))


def box_px(box: Box) -> int:
    """Pixels of a box; 0 where its ends have crossed."""
    x0, y0, x1, y1 = box
    return max(0, x1 - x0 + 1) * max(0, y1 - y0 + 1)


def shared_box(first: Box, second: Box) -> Box:
    """Where two boxes overlap; its ends cross where they do not."""
    (a0, b0, a1, b1), (c0, d0, c1, d1) = first, second
    return max(a0, c0), max(b0, d0), min(a1, c1), min(b1, d1)


def hulls(x: NDArray[np.uint16], y: NDArray[np.uint16], names: NDArray[np.int64], size: tuple[int, int]) -> Mask:
    """The union (H, W) of the convex hulls of clusters of events: pixels whose centre is in a hull or on its border.

    names: (N,) the cluster of each event; 0 is none. A single event is a pixel.
    """
    inside = np.zeros(size, np.bool_)
    order = np.argsort(names, kind="stable")
    points = np.stack((x, y), axis=1).astype(np.int32)[order]
    starts = np.flatnonzero(np.diff(names[order], prepend=0))
    for cluster in np.split(points, starts)[1:]:
        _fill(inside, cv2.convexHull(cluster, clockwise=False)[:, 0].astype(np.int64))
    return inside


def _fill(inside: Mask, corners: NDArray[np.int64]) -> None:
    """Add the pixels of a convex hull, exactly, in whole numbers: each edge bounds the columns of each row.

    OpenCV's own filling adds what the lines of its border touch, up to 2 % of a small hull.

    corners: (K, 2) of x and y, one after the other; with x to the right and y down, the hull lies to the right of the
        edge from each to the next.
    """
    (x0, y0), (x1, y1) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    (dx, dy), rows = (np.roll(corners, -1, axis=0) - corners).T[..., None], np.arange(y0, y1 + 1)
    x, y = corners.T[..., None]
    steps = dx * (rows - y)  # dy (column - x) is not above it
    falls, rises = (dy > 0)[:, 0], (dy < 0)[:, 0]
    last = (x + steps // np.where(dy == 0, 1, dy))[falls].min(axis=0, initial=x1)
    first = (x - (-steps) // np.where(dy == 0, 1, dy))[rises].max(axis=0, initial=x0)
    columns = np.arange(x0, x1 + 1)
    inside[y0 : y1 + 1, x0 : x1 + 1] |= (columns >= first[:, None]) & (columns <= last[:, None])
