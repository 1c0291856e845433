"""Where there is room: boxes parallel to the axes around what is in a scene, so that nothing is drawn into anything."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.scene.bodies import GRATING
from evimo.scene.drawing.furniture import Room
from evimo.scene.motion import Motion

F8 = NDArray[np.float64]
TOUCHING = 0.01  # m that boxes may overlap
FLAT = 0.03  # m: tape, cables and rugs are no higher
STEP_S = 0.05  # between looks at what moves


class Box(NamedTuple):
    """Middle (3,) and half sizes (3,), m."""

    middle: F8
    half: F8


def boxes_of(room: Room) -> list[Box]:
    """Around all that stands in a room; walls, nets and what is flat on the floor have none."""
    solid = [part for part in room.parts if not part.inside and part.shape != GRATING]
    boxes = [Box(part.position, np.abs(part.rotation) @ part.half) for part in solid]
    return [box for box in boxes if box.middle[2] + box.half[2] > FLAT]


def is_free(box: Box, taken: Sequence[Box]) -> bool:
    """Whether a box, or at several places (T, 3) each of them, meets none of the others."""
    if not taken:
        return True
    middles, halves = np.array([other.middle for other in taken]), np.array([other.half for other in taken])
    apart = np.abs(np.atleast_2d(box.middle)[:, None] - middles)
    return not (apart < halves + box.half - TOUCHING).all(axis=-1).any()


def way_of(motion: Motion, seconds: float) -> F8:
    """Places (T, 3) that something moving passes."""
    return motion.at(np.arange(0, seconds + STEP_S, STEP_S)).position


def around(way: F8, half: F8) -> Box:
    """The box that holds a box of these half sizes at every place of its way (T, 3)."""
    low, high = way.min(axis=0) - half, way.max(axis=0) + half
    return Box((low + high) / 2, (high - low) / 2)


def stays_inside(way: F8, half: F8, room: Room) -> bool:
    """Whether it passes neither walls, floor nor ceiling."""
    box = around(way, half)
    low, high = box.middle - box.half, box.middle + box.half
    ends = np.array([room.half * (-1, -1, 0), room.half * (1, 1, 2)])
    return bool((low > ends[0] - TOUCHING).all() and (high < ends[1] + TOUCHING).all())


def stays_on_stage(way: F8, room: Room) -> bool:
    """Whether its middle stays above what things stand on in a room."""
    return bool((way[:, :2] >= room.stage[0]).all() and (way[:, :2] <= room.stage[1]).all())
