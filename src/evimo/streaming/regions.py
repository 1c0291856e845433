"""Regions of one slice that move as one: connected regions of the motion mask, split where the motion differs.

Mixture channels are not objects: the paper supervises only the background's, and the same object may sit in another
channel one slice later. So objects are found in the image, in two steps.

1. Connected regions of the motion mask of at least `smallest_region` pixels. Regions with a gap below `GAP_SHARE`
   of the image's width between them are one: masks have holes and cuts where nothing fires inside an object.
2. Two objects that touch, or pass in front of each other, are one region but have two velocities. A region is cut in
   two where its velocities form two separate groups: projected on their main axis, the best threshold (Otsu's) must
   leave groups far apart against their own spread, against their speed, and against what the networks can tell.
   Comparing neighbouring pixels instead would join the two through one soft edge.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.streaming.tallies import LABELS, extents, weighted_sums

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
U1 = NDArray[np.uint8]
Mask = NDArray[np.bool_]

SMALLEST_SHARE, SMALLEST_PX = 0.001, 4  # of a region: share of the image, and pixels at least
GAP_SHARE = 0.03  # of the width
SMALLEST_PART = 0.04  # share of a region that a part of it must have
APART = 4.5  # distance of two groups' means in standard deviations; cutting one evenly spread group gives 3.5
DIFFERENT = 0.5  # the same distance in speeds of the faster group: 30 degrees apart, or half as fast
SLOWEST = 0.1  # the same distance in mean depths/s: 26 px/s at f = 260 px, less is noise of the networks
CUTS = 2  # rounds of cutting: up to four motions in one region
SAMPLES = 1024  # pixels that the search for the threshold looks at
MOST = LABELS - 1


def smallest_region(size: tuple[int, int]) -> int:
    """Pixels below which a region of an image (height, width) is not an object."""
    return max(SMALLEST_PX, round(SMALLEST_SHARE * size[0] * size[1]))


def regions(moving: Mask, velocity: F4, *, smallest_px: int) -> U1:
    """Number the moving regions, the largest first; at most 255.

    Args:
        moving: (h, w) the motion mask.
        velocity: (3, h, w) of what moves, mean depths/s.
        smallest_px: smaller regions, and smaller parts of a cut, are dropped.

    Returns:
        (h, w) labels: 0 is the background, 1 the largest region.
    """
    labels = _connected(moving, smallest_px, gap_px=round(GAP_SHARE * moving.shape[1]))
    suspects = range(1, MOST + 1)
    for _ in range(CUTS):
        suspects = _cut_all(labels, velocity, smallest_px, _suspects(labels, velocity, smallest_px, suspects))
        if not suspects:
            break
    return _by_size(labels)


def _connected(mask: Mask, smallest_px: int, *, gap_px: int = 0) -> U1:
    """Number the connected regions (8 neighbours) of a mask, the largest first, across gaps of up to `gap_px`."""
    near = mask.view(np.uint8)
    if gap_px:
        side = gap_px // 2 * 2 + 1  # half the gap from either region
        near = cv2.dilate(near, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(near, connectivity=8)
    labels = np.where(mask, labels, 0)
    area_px = np.bincount(labels.ravel(), minlength=len(stats))
    area_px[0] = 0  # of what is not in the mask
    largest = np.argsort(-area_px, kind="stable")[:MOST]
    kept = largest[area_px[largest] >= smallest_px]
    table = np.zeros(len(stats), np.uint8)
    table[kept] = np.arange(1, len(kept) + 1)
    return table[np.asarray(labels, np.int32)]


def _by_size(labels: U1) -> U1:
    """The same regions, the largest first."""
    area_px = extents(labels).area_px
    order = np.argsort(-area_px, kind="stable")
    table = np.zeros(LABELS, np.uint8)
    table[order] = np.where(area_px[order] > 0, np.arange(1, LABELS + 1), 0)
    return table[labels]


def _suspects(labels: U1, velocity: F4, smallest_px: int, among: range | list[int]) -> list[int]:
    """Labels whose velocities vary enough for two groups to be possible: cheap, and sorts out most."""
    weight, first, second = weighted_sums(labels, np.ones(labels.shape, np.float32), velocity)
    area_px = np.maximum(weight, 1)
    mean = first / area_px[:, None]
    variance = second / area_px - (mean**2).sum(axis=1)
    share = np.clip(smallest_px / area_px, SMALLEST_PART, 0.5)
    apart = np.maximum(DIFFERENT**2 * (mean**2).sum(axis=1), SLOWEST**2)
    least = share * (1 - share) * apart  # the variance of two groups just large and far enough
    possible = (weight >= 2 * smallest_px) & (variance > least)
    return [label for label in among if possible[label]]


def _cut_all(labels: U1, velocity: F4, smallest_px: int, suspects: list[int]) -> list[int]:
    """Cut the suspects that move in two ways, in place; the labels of all parts."""
    parts: list[int] = []
    where, used = extents(labels), int(labels.max(initial=0))
    for label in suspects:
        box = slice(where.y0[label], where.y1[label] + 1), slice(where.x0[label], where.x1[label] + 1)
        inside = labels[box] == label
        fast = _faster_part(inside, velocity[:, *box])
        if fast is None:
            continue
        least_px = max(smallest_px, round(SMALLEST_PART * int(where.area_px[label])))
        numbers = _coherent_parts(inside, fast, least_px)
        count = int(numbers.max(initial=0))
        if count < 2 or used + count - 1 > MOST:
            continue
        names = np.array([0, label, *range(used + 1, used + count)], np.uint8)
        labels[box][inside] = names[numbers[inside]]
        parts += names[1:].tolist()
        used += count - 1
    return parts


def _faster_part(inside: Mask, velocity: F4) -> Mask | None:
    """Which pixels of a region move in the second of two ways; None if it moves in one."""
    within: F4 = velocity[:, inside]
    cut = _two_motions(within[:, :: 1 + within.shape[1] // SAMPLES].astype(np.float64))
    if cut is None:
        return None
    axis, threshold = cut
    fast = np.zeros_like(inside)
    fast[inside] = axis.astype(np.float32) @ within > threshold
    return fast


def _two_motions(velocity: F8) -> tuple[F8, float] | None:
    """Axis (3,) and threshold along it between two groups of velocities (3, N); None if there is one group.

    The threshold is the one that explains most of the variance along the axis (Otsu 1979), over all thresholds.
    """
    count = velocity.shape[1]
    middle = velocity.sum(axis=1) / count
    centred = velocity - middle[:, None]
    axis: F8 = np.linalg.eigh(centred @ centred.T)[1][:, -1]
    along: F8 = axis @ centred
    ordered = np.sort(along)
    below = np.arange(1, count)
    sums = np.cumsum(ordered)[:-1]  # the mean is 0: what is below and what is above sum to 0
    apart = -sums / (count - below) - sums / below
    explained = below * (count - below) * apart**2
    best = int(np.argmax(explained))
    threshold = (ordered[best] + ordered[best + 1]) / 2
    spread = np.sqrt(max(0.0, (along @ along) / count - explained[best] / count**2))
    shift = axis * sums[best]  # from the means of the groups along the axis to those in space
    speed = max(
        float(np.linalg.norm(middle + shift / (best + 1))), float(np.linalg.norm(middle - shift / (count - best - 1)))
    )
    far = apart[best] > max(APART * spread, DIFFERENT * speed, SLOWEST)
    return (axis, threshold + float(axis @ middle)) if far else None


def _coherent_parts(inside: Mask, fast: Mask, smallest_px: int) -> U1:
    """Number the connected parts of both groups of a region; crumbs of one group go to the other.

    Empty unless both groups have a part large enough.
    """
    groups = inside & fast, inside & ~fast
    large = [_connected(group, smallest_px) > 0 for group in groups]
    if not all(group.any() for group in large):
        return np.zeros(inside.shape, np.uint8)
    crumbs = inside & ~large[0] & ~large[1]
    faster, slower = (
        _connected(part | (crumbs & other), smallest_px) for part, other in zip(large, groups[::-1], strict=True)
    )
    count = int(faster.max(initial=0))
    return np.where(slower > 0, slower + count, faster).astype(np.uint8)
