"""Point clouds as small discs that lie in the scanned surface and meet where points lie evenly, finer and coarser."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
I8 = NDArray[np.int64]

NEIGHBOURS = 16  # the point itself among them, whose plane is the disc's
DIRECTIONS = 16  # in that plane, in which the point's cell is measured
BETWEEN = 1.05  # a cell reaches farther between two directions
REACH = 11  # no cell reaches farther than to this neighbour: at the rim of a scan they are open
WIDEST = 3.0  # medians of the radii: points on their own are not drawn larger
FEWEST = 400  # points of the coarsest level
COARSER = 1.5  # of the distance between points from one level to the next
AT_ONCE = 50_000  # points whose neighbours are looked at together


class Discs(NamedTuple):
    """N discs: centres (N, 3), unit normals (N, 3) of either sign, and radii (N,), m."""

    centre: F4
    normal: F4
    radius: F4


class Level(NamedTuple):
    """Discs of one fineness, and the number (N,) of the scan's point that each stands for."""

    discs: Discs
    numbers: I8


def disc_levels(points: F8) -> list[Level]:
    """Discs for points (N, 3) from the finest level, all points, to the coarsest, each with fewer than the one before.

    A scan that is seen from afar has hundreds of points in a pixel, of which a few show the same.
    """
    index = np.arange(len(points))
    levels = [Level(discs_of(points), index)]
    step = COARSER * float(np.median(levels[0].discs.radius))
    while len(index) > FEWEST and step > 0:
        fewer = index[_one_in_each_cell(points[index], step)]
        if len(fewer) < 0.8 * len(index):
            index = fewer
            levels.append(Level(discs_of(points[index]), index))
        step *= COARSER
    return levels


def discs_of(points: F8) -> Discs:
    """A disc for each point, in the plane through its neighbours.

    It is as wide as the point's cell, of all that is nearer to it than to any neighbour (Voronoi's), so that discs
    together leave no hole, and overlap no more than they must; but `WIDEST` keeps points on their own small.
    """
    count = min(NEIGHBOURS, len(points))
    tree = KDTree(points)
    normal, radius = np.empty((len(points), 3), np.float32), np.empty(len(points), np.float32)
    for first in range(0, len(points), AT_ONCE):
        some = slice(first, first + AT_ONCE)
        distance, index = tree.query(points[some], k=count)
        distance, index = distance.reshape(-1, count), index.reshape(-1, count)
        near = points[index] - points[index].mean(axis=1, keepdims=True)
        axes = np.linalg.eigh(np.einsum("nki,nkj->nij", near, near))[1]
        normal[some] = axes[:, :, 0]
        flat = (points[index] - points[some, None]) @ axes[:, :, 1:]
        radius[some] = np.minimum(_cell_radius(flat), distance[:, min(REACH, count - 1)])
    return Discs(points.astype(np.float32), normal, np.minimum(radius, WIDEST * np.median(radius)))


def _cell_radius(flat: F8) -> F8:
    """How far the cell of a point reaches whose neighbours lie at flat (N, K, 2) from it; infinite where it is open."""
    angle = np.arange(DIRECTIONS) * (2 * np.pi / DIRECTIONS)
    ways = np.stack((np.cos(angle), np.sin(angle)))
    along, half2 = flat @ ways, 0.5 * (flat**2).sum(axis=-1, keepdims=True)
    border = np.divide(half2, along, out=np.full_like(along, np.inf), where=along > 1e-3 * np.sqrt(half2) + 1e-12)
    return BETWEEN * border.min(axis=1).max(axis=1)


def _one_in_each_cell(points: F8, step: float) -> I8:
    """Indices of the point next to the middle of each cube of a grid that holds any."""
    place = (points - points.min(axis=0)) / step
    cell = np.floor(place).astype(np.int64)
    sizes = cell.max(axis=0) + 1
    key = (cell[:, 0] * sizes[1] + cell[:, 1]) * sizes[2] + cell[:, 2]
    order = np.lexsort((((place - cell - 0.5) ** 2).sum(axis=1), key))
    return np.sort(order[np.unique(key[order], return_index=True)[1]])
