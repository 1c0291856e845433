"""Marks of single objects: labels with ids, arrows with speeds."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from evimo.viewing.colours import Image, direction_colours, id_colour
from evimo.viewing.layout import Box
from evimo.viewing.maps import Zoom
from evimo.viewing.moment import Mark
from evimo.viewing.strokes import arrow, chip, free_place, text_width, z_sign

LONGEST_ARROW = 0.22
"""Length of the arrow of the fastest object, as a share of the panel's width."""

ALONG_Z = 0.3
"""Share of the speed along the optical axis from which on it is said."""

_LABEL_HEIGHT = 18
_MARGIN = 10


def velocity_table(objects: Sequence[Mark], *, full: float) -> Image:
    """(256, 3) uint8: `table[ids]` paints each object by the direction of its velocity; the background is black."""
    table = np.zeros((256, 3), np.uint8)
    for one in objects:
        table[one.id] = direction_colours(one.velocity[:2], full=full)
    return table


def label_objects(panel: Image, objects: Sequence[Mark], *, zoom: Zoom) -> None:
    """Write each object's id beside it, in place."""
    boxes = {one.id: _box(one, zoom) for one in objects}
    labels: list[Box] = []
    for one in objects:
        others = [box for object_id, box in boxes.items() if object_id != one.id]
        labels.append(_label(panel, f"{one.id}", one, around=boxes[one.id], taken=[*labels, *others]))


def draw_velocities(panel: Image, objects: Sequence[Mark], *, zoom: Zoom, full: float) -> None:
    """Draw an arrow from each object's centroid, and its speed beside it, in place.

    `full`: speed of the longest arrow, in lengths per second.
    """
    taken: list[Box] = []
    for one in objects:
        velocity = one.velocity
        start = zoom.point(np.array(one.centroid))
        stop = start + velocity[:2] / full * LONGEST_ARROW * panel.shape[1]
        start, stop = inside(start, stop, panel.shape[:2])
        if np.linalg.norm(stop - start) >= 3:
            arrow(panel, start, stop)
        if speaks_of_z(velocity):
            z_sign(panel, start, towards=bool(velocity[2] < 0))
        low, high = np.minimum(start, stop) - 6, np.maximum(start, stop) + 6
        taken.append(Box(int(low[0]), int(low[1]), int(high[0] - low[0]), int(high[1] - low[1])))
    for one in objects:
        taken.append(_label(panel, described(one), one, around=_box(one, zoom), taken=taken))


def described(one: Mark) -> str:
    """Id, speed in lengths per second, and whether it comes or goes: `2: 0.41 away`."""
    velocity = one.velocity
    words = "" if not speaks_of_z(velocity) else " towards" if velocity[2] < 0 else " away"
    return f"{one.id}: {np.linalg.norm(velocity):.2f}{words}"


def speaks_of_z(velocity: NDArray[np.float64]) -> bool:
    """Whether a velocity has enough of the optical axis in it."""
    return bool(abs(velocity[2]) > ALONG_Z * np.linalg.norm(velocity))


def inside(
    start: NDArray[np.float64], stop: NDArray[np.float64], size: tuple[int, ...]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The same arrow, moved by as little as keeps both ends inside an image of (height, width)."""
    low, high = np.minimum(start, stop), np.maximum(start, stop)
    room = np.array([size[1], size[0]]) - 1.0 - _MARGIN
    move = np.maximum(_MARGIN - low, 0) - np.maximum(high - room, 0)
    return start + move, stop + move


def _box(one: Mark, zoom: Zoom) -> Box:
    left, top = zoom.point(np.array(one.box[:2]) - 0.5)
    right, bottom = zoom.point(np.array(one.box[2:]) + 0.5)
    return Box(round(left), round(top), round(right - left), round(bottom - top))


def _label(panel: Image, text: str, one: Mark, *, around: Box, taken: Sequence[Box]) -> Box:
    width = text_width(text, bold=True) + 8
    place = free_place((_LABEL_HEIGHT, width), around=around, inside=panel.shape[:2], taken=taken)
    chip(panel, text, place, colour=id_colour(one.id))
    return place
