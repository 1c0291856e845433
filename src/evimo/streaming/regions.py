"""Regions of one slice that move as one: connected regions of the motion mask, split where the motion differs.

Mixture channels are not objects: the paper supervises only the background's, and the same object may sit in another
channel one slice later. So objects are found in the image, in two steps.

1. Connected regions (8 neighbours) of the motion mask of at least `smallest_region` pixels.
2. Two objects that touch, or pass in front of each other, are one region but have two velocities. A region is cut in
   two where its velocities form two separate groups: projected on their main axis, the best threshold (Otsu's) must
   leave groups far apart against their own spread and against their speed. Comparing neighbouring pixels instead
   would join the two through one soft edge.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

F4 = NDArray[np.float32]

SMALLEST_SHARE, SMALLEST_PX = 0.0005, 12  # of a region: share of the image, and pixels at least
APART = 4.5  # distance of two groups' means in standard deviations; cutting one evenly spread group gives 3.5
DIFFERENT = 0.5  # the same distance in speeds of the faster group: 30 degrees apart, or half as fast
CUTS = 2  # rounds of cutting: up to four objects in one region
SAMPLES = 4096  # pixels that the search for the threshold looks at
BINS = 64


def smallest_region(size: tuple[int, int]) -> int:
    """Pixels below which a region of an image (height, width) is not an object."""
    return max(SMALLEST_PX, round(SMALLEST_SHARE * size[0] * size[1]))


def regions(moving: NDArray[np.bool_], velocity: F4, *, smallest_px: int, most: int = 255) -> NDArray[np.uint8]:
    """Number the moving regions, the largest first.

    Args:
        moving: (h, w) the motion mask.
        velocity: (3, h, w) of what moves, any unit.
        smallest_px: smaller regions, and smaller parts of a cut, are dropped.
        most: how many to keep, at most 255.

    Returns:
        (h, w) labels: 0 is the background, 1 the largest region.
    """
    found = [mask for mask in _connected(moving, smallest_px) if mask.area_px >= smallest_px]
    for _ in range(CUTS):
        found = [part for region in found for part in _cut(region, velocity, smallest_px)]
    found.sort(key=lambda region: -region.area_px)
    labels = np.zeros(moving.shape, np.uint8)
    for number, region in enumerate(found[:most], start=1):
        labels[region.rows, region.columns][region.mask] = number
    return labels


class _Region:
    """A mask (h', w') inside the box `rows`, `columns` of the image."""

    def __init__(self, rows: slice, columns: slice, mask: NDArray[np.bool_]) -> None:
        self.rows, self.columns, self.mask = rows, columns, mask
        self.area_px = int(np.count_nonzero(mask))


def _connected(mask: NDArray[np.bool_], smallest_px: int, *, row: int = 0, column: int = 0) -> list[_Region]:
    """Connected regions of a mask whose first pixel is at (row, column) of the image."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=8, ltype=cv2.CV_16U)
    found: list[_Region] = []
    for number in np.flatnonzero(stats[:, cv2.CC_STAT_AREA] >= smallest_px):
        if number:  # 0 is the rest
            x, y, width, height = stats[number, :4].tolist()
            inside = labels[y : y + height, x : x + width] == number
            found.append(_Region(slice(row + y, row + y + height), slice(column + x, column + x + width), inside))
    return found


def _cut(region: _Region, velocity: F4, smallest_px: int) -> list[_Region]:
    """The region, or its parts if it moves in two ways."""
    if region.area_px < 2 * smallest_px:
        return [region]
    inside: F4 = velocity[:, region.rows, region.columns][:, region.mask]
    cut = _two_motions(inside[:, :: max(1, inside.shape[1] // SAMPLES)])
    if cut is None:
        return [region]
    axis, threshold = cut
    fast = np.zeros_like(region.mask)
    fast[region.mask] = axis @ inside > threshold
    return _coherent_parts(region, fast, smallest_px) or [region]


def _two_motions(velocity: F4) -> tuple[F4, float] | None:
    """Axis (3,) and threshold along it between two groups of velocities (3, N); None if there is one group."""
    centred = velocity - velocity.mean(axis=1, keepdims=True)
    axis: F4 = np.linalg.eigh(centred @ centred.T)[1][:, -1]
    along: F4 = axis @ velocity
    threshold = _otsu(along)
    slow, fast = along <= threshold, along > threshold
    if not slow.any() or not fast.any():
        return None
    spread = np.sqrt((along[slow].var() * slow.sum() + along[fast].var() * fast.sum()) / len(along))
    between = velocity[:, fast].mean(axis=1) - velocity[:, slow].mean(axis=1)
    speed = max(float(np.linalg.norm(velocity[:, group].mean(axis=1))) for group in (slow, fast))
    apart = float(np.linalg.norm(between))
    return (axis, threshold) if apart > APART * spread and apart > DIFFERENT * speed else None


def _otsu(values: F4) -> float:
    """The threshold between two groups of values (N,) that explains most of their variance (Otsu 1979)."""
    counts, edges = np.histogram(values, BINS)
    below = np.cumsum(counts)[:-1]
    above = len(values) - below
    sums = np.cumsum(counts * (edges[:-1] + edges[1:]) / 2)
    means_apart = sums[:-1] / np.maximum(below, 1) - (sums[-1] - sums[:-1]) / np.maximum(above, 1)
    explained = below * above * means_apart**2
    best = np.flatnonzero(explained >= explained.max() * (1 - 1e-9))
    return float(edges[1 + best].mean())  # the middle of an empty gap


def _coherent_parts(region: _Region, fast: NDArray[np.bool_], smallest_px: int) -> list[_Region]:
    """Connected parts of both groups; crumbs of one group go to the other. Empty unless there are two parts."""
    kept = [_connected(group, smallest_px) for group in (fast, region.mask & ~fast)]
    if not all(kept):
        return []
    of_fast, of_slow = (np.zeros_like(region.mask) for _ in range(2))
    for group, parts in zip((of_fast, of_slow), kept, strict=True):
        for part in parts:
            group[part.rows, part.columns] |= part.mask
    crumbs = region.mask & ~of_fast & ~of_slow
    of_slow |= crumbs & fast
    of_fast |= crumbs & ~fast
    corner = {"row": region.rows.start, "column": region.columns.start}
    return [part for group in (of_fast, of_slow) for part in _connected(group, smallest_px, **corner)]
