# pyright: basic
"""What does not fit the world's motion: the time image after compensation, and how far a place's events are sorted.

Events of the static world that were carried back rightly come to each place at any time of the slice, so that their
times cancel out. Where something moves otherwise its edges sweep over the places, one after the other: each holds
events of one moment, early on one side and late on the other (Mitrokhin et al. 2018). That alone finds parallax and
noise as well. It counts together with how crowded the events are, the strongest cue that needs no motion.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.classical.sharpness import ARM
from evimo.classical.world import Scene
from evimo.compiling import njit

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]

STEP = 2  # px of the picture per pixel of the maps
REACH = 0.5  # slices about the centre whose events take part
AROUND = 3.0  # pixels of the maps: standard deviation of what counts as one place
CROWD_POWER = 1.5
CALM_COUNT, CALM_TIME, CALM_SORTED = 0.3, 1.0, 0.01  # times the mean, added so that few events tell little
NOISE = 0.03  # events per pixel, added to their mean
PER_CROWD = 0.5  # of the log of their mean: where events are many, all times look alike sooner


class Misfit(NamedTuple):
    """Maps of half the picture, (h, w). score: how much a place moves otherwise, in logs. crowd: events per pixel."""

    score: F4
    crowd: F4


def misfit(scene: Scene, motion: F8) -> Misfit:
    """Return how badly each place's events fit a motion (4,) of the whole picture."""
    height, width = (-(-side // STEP) for side in scene.size)
    images = np.zeros((3, height, width), np.float32)
    _time_images(scene.x, scene.y, scene.t, motion, scene.centre, images)
    np.multiply(images[1], images[1], out=images[1])
    crowd, ordered, spread = (np.asarray(cv2.GaussianBlur(each, (0, 0), AROUND), np.float32) for each in images)
    mean = np.float32(images[0].mean() + NOISE)
    mean_square = mean * np.float32(REACH**2 / 3)  # of times that are spread evenly
    score = np.empty_like(crowd)
    _score(crowd, ordered, spread, (mean, mean_square), score)
    return Misfit(score, crowd)


@njit(nogil=True, fastmath=True)
def _score(crowd, ordered, spread, means, score):
    mean, square = means
    offset = np.float32(PER_CROWD) * np.log(mean)
    for row in range(crowd.shape[0]):
        for k in range(crowd.shape[1]):
            alike = (ordered[row, k] + np.float32(CALM_SORTED) * square) / (
                spread[row, k] + np.float32(CALM_TIME) * square
            )
            crowded = (crowd[row, k] + np.float32(CALM_COUNT) * mean) / mean
            score[row, k] = np.log(alike) + np.float32(CROWD_POWER) * np.log(crowded) - offset


@njit(nogil=True, fastmath=True)
def _time_images(x, y, t, motion, centre, images):
    """Sum 1, t and t² of the events where they were at the slice's centre, shared between four pixels."""
    _, height, width = images.shape
    half, one, scale, reach = np.float32(0.5), np.float32(1), np.float32(1 / STEP), np.float32(REACH)
    u, v, s, r = np.float32(motion[0]), np.float32(motion[1]), np.float32(motion[2] / ARM), np.float32(motion[3] / ARM)
    cx, cy = np.float32(centre[0]), np.float32(centre[1])
    for k in range(len(x)):
        when = t[k]
        dx, dy = x[k] - cx, y[k] - cy
        at_x = (x[k] - when * (u + s * dx - r * dy) + half) * scale - half
        at_y = (y[k] - when * (v + s * dy + r * dx) + half) * scale - half
        if abs(when) > reach or not (0 <= at_x < width - 1 and 0 <= at_y < height - 1):
            continue
        column, row = int(at_x), int(at_y)
        ax, ay = at_x - np.float32(column), at_y - np.float32(row)
        for down in range(2):
            for beside in range(2):
                share = (ay if down else one - ay) * (ax if beside else one - ax)
                images[0, row + down, column + beside] += share
                images[1, row + down, column + beside] += share * when
                images[2, row + down, column + beside] += share * when * when
