"""Compensations as a first pass makes them: nearly right, wrong in ways that look right.

The second pass is trained on the truth disturbed by errors of all sizes rather than on one first pass's own, so that
both passes train at once, and the second one serves any first one (docs/decisions/0006-compensate-first.md).
"""

import math

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from evimo.events.stack import StaticMotion

F4 = NDArray[np.float32]

LEVELS = (0.03, 2.5)  # size of the errors, drawn evenly in its logarithm
FLAT = 0.12  # share of compensations whose depth is the same everywhere
SMOOTH = (0.7, 20.0)  # of the others: width of the blur, pixels of the depth, drawn evenly in its logarithm
TRANSLATION, ROTATION, OWN = 0.35, 0.1, 0.4  # of the speed in the picture, at level 1; share that each slice has anew
LEAST_SPEED = 0.004  # mean depths or rad per slice: a camera at rest is seen to move a little, too
BUMPS = ((3, 0.3), (9, 0.3), (24, 0.2))  # cells across the image and size of errors in log depth, at level 1


def disturbed(truth: StaticMotion, rng: Generator, *, known_rotation: bool) -> StaticMotion:
    """A compensation with errors of a random size.

    Errors of translation are mostly made up for by rotation, as a first pass confuses them: x with yaw, y with pitch.
    With a known rotation there are none of that. Depth is blurred as a first pass sees it: with outlines as sharp as
    the truth's, a second pass learns to look for objects in its depth, and finds none when it runs.
    """
    level = math.exp(rng.uniform(*np.log(LEVELS)))
    twist = truth.twist + _twist_error(truth.twist, level, rng, known_rotation=known_rotation)
    inv_depth = np.ones_like(truth.inv_depth)
    if rng.random() >= FLAT:
        width = math.exp(rng.uniform(*np.log(SMOOTH)))
        smooth = cv2.GaussianBlur(np.log(np.maximum(truth.inv_depth, np.float32(1e-3))), (0, 0), width)
        inv_depth = np.exp(smooth + sum(_bumps(smooth.shape, c, level * k, rng) for c, k in BUMPS))
    return truth._replace(twist=twist.astype(np.float32), inv_depth=inv_depth.astype(np.float32))


def _twist_error(twist: F4, level: float, rng: Generator, *, known_rotation: bool) -> F4:
    speed = max(
        float(np.linalg.norm(twist[:, :3], axis=1).mean()),
        0.6 * float(np.linalg.norm(twist[:, 3:], axis=1).mean()),
        LEAST_SPEED,
    )
    drawn = rng.normal(size=(1, 6)) + OWN * rng.normal(size=twist.shape)
    error = (drawn * speed * level * np.repeat((TRANSLATION, ROTATION), 3)).astype(np.float32)
    traded = rng.uniform(0.6, 1.1, 2)
    error[:, 4] -= traded[0] * error[:, 0]
    error[:, 3] += traded[1] * error[:, 1]
    if known_rotation:
        error[:, 3:] *= 0.03
    slower = np.float32(min(1.0, 0.3 * level * rng.random()))
    return (error - twist * slower * np.repeat((1, not known_rotation), 3)).astype(np.float32)


def _bumps(size: tuple[int, ...], cells: int, height: float, rng: Generator) -> F4:
    """A smooth random field of unit variance times `height`."""
    coarse = rng.normal(size=(cells, cells)).astype(np.float32) * np.float32(height)
    return np.asarray(cv2.resize(coarse, (size[1], size[0]), interpolation=cv2.INTER_LINEAR), np.float32)
