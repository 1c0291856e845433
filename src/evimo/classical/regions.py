"""The own motion of each region that does not fit the world's: the same four parameters, fitted to its events alone."""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.classical.sharpness import ARM
from evimo.classical.world import Scene, searched

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
U1 = NDArray[np.uint8]

STEP = 2  # px of the picture per pixel of a map of regions
SMALLEST = 0.0005  # share of the picture
MOST = 12  # regions of one slice, the largest ones
MOST_EVENTS = 3000  # that a region's motion is fitted to
STEPS = (4, 2)  # px of the picture per pixel of the images of the search
AROUND_PX = 12  # of the picture, that events may come from around a region's box
BESIDE = 4  # pixels of a map around a region that get its motion


class Region(NamedTuple):
    """One region. motion: (4,) as in `sharpness` about its centre (x, y), px of the picture."""

    motion: F8
    centre: tuple[float, float]


def motion_about(motion: F8, centre: tuple[float, float], at: tuple[float, float]) -> F8:
    """The same motion of the picture, written about another centre."""
    dx, dy = (at[0] - centre[0]) / ARM, (at[1] - centre[1]) / ARM
    u, v, s, r = motion
    return np.array((u + s * dx - r * dy, v + s * dy + r * dx, s, r))


def flow_of(motion: F8, centre: tuple[float, float], size: tuple[int, int]) -> F4:
    """The flow (2, h, w) of a motion, px of the picture per slice, in a map of (h, w) pixels."""
    dx = (((np.arange(size[1]) + 0.5) * STEP - 0.5 - centre[0]) / ARM).astype(np.float32)[None]
    dy = (((np.arange(size[0]) + 0.5) * STEP - 0.5 - centre[1]) / ARM).astype(np.float32)[:, None]
    u, v, s, r = motion.astype(np.float32)
    return np.stack((u + s * dx - r * dy, v + s * dy + r * dx))


def fitted_regions(moving: U1, scene: Scene, world: F8) -> tuple[U1, list[Region]]:
    """Fit a motion to each connected region of a map.

    Args:
        moving: (h, w), not 0 where something moves otherwise than the world.
        scene: the events.
        world: (4,) the world's motion about the scene's centre: where each search starts.

    Returns:
        (h, w) numbers, 0 is the world, also right around each region; and the regions from number 1 on, the largest
        first.
    """
    count, labels, stats, centres = cv2.connectedComponentsWithStats(moving, connectivity=8)
    area = stats[:, cv2.CC_STAT_AREA]
    largest = [each for each in np.argsort(-area, kind="stable").tolist() if each > 0 and area[each] >= SMALLEST * moving.size]
    numbers, found = np.zeros(count, np.uint8), list[Region]()
    for label in largest[:MOST]:
        x0, y0, width, height = stats[label, :4].tolist()
        box = slice(y0, y0 + height), slice(x0, x0 + width)
        centre = STEP * (centres[label, 0] + 0.5) - 0.5, STEP * (centres[label, 1] + 0.5) - 0.5
        start = motion_about(world, scene.centre, centre)
        found.append(Region(_own_motion(labels[box] == label, (x0, y0), scene, start, centre), centre))
        numbers[label] = len(found)
    square = cv2.getStructuringElement(cv2.MORPH_RECT, (2 * BESIDE + 1, 2 * BESIDE + 1))
    named = numbers[labels]
    return np.where(named > 0, named, cv2.dilate(named, square)), found


def _own_motion(
    inside: NDArray[np.bool_], corner: tuple[int, int], scene: Scene, start: F8, centre: tuple[float, float]
) -> F8:
    """The motion of a region given by its pixels within their box."""
    edge = AROUND_PX // STEP
    soft = cv2.GaussianBlur(cv2.dilate(np.pad(inside, edge).view(np.uint8), np.ones((3, 3))).astype(np.float32), (0, 0), 1)
    left, top = (STEP * each - AROUND_PX for each in corner)
    height, width = (STEP * side for side in soft.shape)
    there = (scene.x >= left) & (scene.x < left + width - 1) & (scene.y >= top) & (scene.y < top + height - 1)
    near = np.flatnonzero(there)
    near = near[:: 1 + len(near) // MOST_EVENTS]
    x, y = scene.x[near] - np.float32(left), scene.y[near] - np.float32(top)
    weight = soft[(y + np.float32(0.5)).astype(np.intp) // STEP, (x + np.float32(0.5)).astype(np.intp) // STEP]
    part = Scene(x, y, scene.t[near], (height, width), (centre[0] - left, centre[1] - top))
    return searched(part, weight, start, steps=STEPS)
