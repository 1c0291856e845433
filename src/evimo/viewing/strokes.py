"""Text, chips and arrows, placed by what they mean."""

from collections.abc import Sequence
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.viewing.colours import DARK, INK, RGB, Image
from evimo.viewing.layout import Box

Align = Literal["left", "centre", "right"]

TITLE, PLAIN, SMALL = 0.55, 0.48, 0.43
"""Sizes of letters, as OpenCV counts them; a capital is about 21 times as many px high."""

_PER_PX_AWAY = 6
"""Covered pixels that weigh as much as one pixel between a label and what it belongs to."""

_CAPITAL = 21
_SHIFT = 4
"""Fractional bits of OpenCV's sub-pixel coordinates."""


def text_width(text: str, *, size: float = PLAIN, bold: bool = False) -> int:
    """Columns that `write` covers."""
    return cv2.getTextSize(text, _font(bold), size, 1)[0][0]


def write(
    image: Image,
    text: str,
    at: tuple[float, float],
    *,
    size: float = PLAIN,
    colour: RGB = INK,
    bold: bool = False,
    align: Align = "left",
) -> int:
    """Write ASCII text, its capitals centred on row `at[1]`; returns the column behind it."""
    width = text_width(text, size=size, bold=bold)
    left = round(at[0] - {"left": 0, "centre": width / 2, "right": width}[align])
    baseline = round(at[1] + size * _CAPITAL / 2)
    cv2.putText(image, text, (left, baseline), _font(bold), size, colour, 1, cv2.LINE_AA)
    return left + width


def swatch(image: Image, at: tuple[int, int], *, fill: RGB | Image) -> int:
    """A square of 11 px of a legend, centred on row `at[1]`; returns the column behind it and a space."""
    x, y = at[0], at[1] - 5
    image[y : y + 11, x : x + 11] = fill
    return x + 16


def chip(image: Image, text: str, box: Box, *, colour: RGB) -> None:
    """A small filled label with dark letters."""
    box.of(image)[:] = colour
    write(image, text, (box.x + box.width / 2, box.y + box.height / 2), colour=DARK, bold=True, align="centre")


def arrow(image: Image, start: NDArray[np.float64], stop: NDArray[np.float64]) -> None:
    """A white arrow with a dark rim."""
    length = float(np.linalg.norm(stop - start))
    tip = min(11 / max(length, 1e-6), 0.6)
    for colour, thickness in ((DARK, 6), (INK, 2)):
        cv2.arrowedLine(image, _fixed(start), _fixed(stop), colour, thickness, cv2.LINE_AA, _SHIFT, tip)


def z_sign(image: Image, at: NDArray[np.float64], *, towards: bool, radius: int = 8) -> None:
    """A circle with a dot (towards the viewer) or with a cross (away), as in physics."""
    cv2.circle(image, _fixed(at), (radius + 2) << _SHIFT, DARK, -1, cv2.LINE_AA, _SHIFT)
    cv2.circle(image, _fixed(at), radius << _SHIFT, INK, 1, cv2.LINE_AA, _SHIFT)
    if towards:
        cv2.circle(image, _fixed(at), 3 << _SHIFT, INK, -1, cv2.LINE_AA, _SHIFT)
        return
    for slope in (1, -1):
        arm = np.array([1, slope]) * radius * 0.7
        cv2.line(image, _fixed(at - arm), _fixed(at + arm), INK, 1, cv2.LINE_AA, _SHIFT)


def polyline(image: Image, points: NDArray[np.float64], *, colour: RGB, thickness: int = 2) -> None:
    """An open line through (N, 2) points in px."""
    fixed = np.rint(points * (1 << _SHIFT)).astype(np.int32)
    cv2.polylines(image, [fixed], False, colour, thickness, cv2.LINE_AA, _SHIFT)


def free_place(size: tuple[int, int], *, around: Box, inside: tuple[int, int], taken: Sequence[Box]) -> Box:
    """Where a label fits to a box: amid a large one, else above, below, right, left, within, further away.

    Args:
        size: (height, width) of the label.
        around: what it belongs to.
        inside: (height, width) of the image; the label does not leave it.
        taken: what it should not cover. Without a free place nearby, the one that covers least and is nearest.
    """
    height, width = size
    above, below = around.y - height - 2, around.bottom + 2
    places = [(around.x, above), (around.x, below), (around.right + 2, around.y), (around.x - width - 2, around.y)]
    middle = around.x + (around.width - width) // 2, around.y + (around.height - height) // 2
    if around.width >= 2 * width and around.height >= 2 * height:
        places = [middle, *places]
    places += [(middle[0], around.y + 4), (middle[0], around.bottom - height - 4)]
    places += [(around.x, row) for step in (20, 40, 60) for row in (above - step, below + step)]
    boxes = [
        Box(min(max(x, 0), max(inside[1] - width, 0)), min(max(y, 0), max(inside[0] - height, 0)), width, height)
        for x, y in places
    ]
    covered = [sum(box.overlap(other) for other in taken) for box in boxes]
    if 0 in covered[:5]:
        return boxes[covered.index(0)]
    costs = [pixels + _PER_PX_AWAY * box.distance(around) for pixels, box in zip(covered, boxes, strict=True)]
    return boxes[costs.index(min(costs))]


def _font(bold: bool) -> int:
    return cv2.FONT_HERSHEY_DUPLEX if bold else cv2.FONT_HERSHEY_SIMPLEX


def _fixed(point: NDArray[np.float64]) -> tuple[int, int]:
    return round(float(point[0]) * (1 << _SHIFT)), round(float(point[1]) * (1 << _SHIFT))
