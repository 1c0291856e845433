"""The own motion of each region that does not fit the world's: the same four parameters, fitted to its events alone."""

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
MOST = 6  # regions of one slice, the largest ones
MOST_EVENTS = 1500  # that a region's motion is fitted to
STEPS = (4, 2)  # px of the picture per pixel of the images of the search
AROUND_PX = 12  # of the picture, that events may come from around a region's box
BESIDE = 4  # pixels of a map around a region that get its motion


def motion_about(motion: F8, centre: tuple[float, float], at: tuple[float, float]) -> F8:
    """The same motion of the picture, written about another centre."""
    dx, dy = (at[0] - centre[0]) / ARM, (at[1] - centre[1]) / ARM
    u, v, s, r = motion.tolist()
    return np.array((u + s * dx - r * dy, v + s * dy + r * dx, s, r))


def flow_of(motions: F8, numbers: U1, centre: tuple[float, float]) -> F4:
    """The flow (2, h, w), px of the picture per slice, of the motions (K, 4) about one centre that pixels number."""
    height, width = numbers.shape
    dx = (((np.arange(width) + 0.5) * STEP - 0.5 - centre[0]) / ARM).astype(np.float32)[None]
    dy = (((np.arange(height) + 0.5) * STEP - 0.5 - centre[1]) / ARM).astype(np.float32)[:, None]
    u, v, s, r = motions.T.astype(np.float32)[:, numbers]
    return np.stack((u + s * dx - r * dy, v + s * dy + r * dx))


def fitted_regions(moving: U1, scene: Scene, world: F8) -> tuple[U1, F8]:
    """Fit a motion to each connected region of a map.

    Args:
        moving: (h, w), not 0 where something moves otherwise than the world.
        scene: the events.
        world: (4,) the world's motion: where each search starts.

    Returns:
        (h, w) numbers of motions, 0 is the world's, those of regions reach a few pixels around them; and the motions
        (K, 4) about the scene's centre, the world's first, then from the largest region to the smallest.
    """
    _, found, stats, centres = cv2.connectedComponentsWithStats(moving, connectivity=8)
    labels, area = np.asarray(found, np.int32), stats[:, cv2.CC_STAT_AREA]
    largest = [each for each in np.argsort(-area, kind="stable").tolist() if each > 0]
    table, motions = np.zeros(len(stats), np.uint8), [world]
    for label in largest[:MOST]:
        if area[label] < SMALLEST * moving.size:
            break
        x0, y0, width, height = stats[label, :4].tolist()
        inside = labels[y0 : y0 + height, x0 : x0 + width] == label
        centre = STEP * (float(centres[label, 0]) + 0.5) - 0.5, STEP * (float(centres[label, 1]) + 0.5) - 0.5
        own = _own_motion(inside, (x0, y0), scene, motion_about(world, scene.centre, centre), centre)
        table[label] = len(motions)
        motions.append(motion_about(own, centre, scene.centre))
    numbers = table[labels]
    square = cv2.getStructuringElement(cv2.MORPH_RECT, (2 * BESIDE + 1, 2 * BESIDE + 1))
    around = np.asarray(cv2.dilate(numbers, square), np.uint8)
    return np.where(numbers > 0, numbers, around), np.stack(motions)


def _own_motion(
    inside: NDArray[np.bool_], corner: tuple[int, int], scene: Scene, start: F8, centre: tuple[float, float]
) -> F8:
    """The motion about `centre` of a region, given by its pixels within their box."""
    edge = AROUND_PX // STEP
    wide = cv2.dilate(np.pad(inside, edge).view(np.uint8), np.ones((3, 3), np.uint8)).astype(np.float32)
    soft = np.asarray(cv2.GaussianBlur(wide, (0, 0), 1), np.float32)
    left, top = (STEP * each - AROUND_PX for each in corner)
    height, width = (STEP * side for side in soft.shape)
    near = np.flatnonzero(
        (scene.x >= left) & (scene.x < left + width - 1) & (scene.y >= top) & (scene.y < top + height - 1)
    )
    near = near[:: 1 + len(near) // MOST_EVENTS]
    x, y = scene.x[near] - np.float32(left), scene.y[near] - np.float32(top)
    weight = soft[(y + np.float32(0.5)).astype(np.intp) // STEP, (x + np.float32(0.5)).astype(np.intp) // STEP]
    part = Scene(x, y, scene.t[near], (height, width), (centre[0] - left, centre[1] - top))
    return searched(part, weight, start, steps=STEPS)
