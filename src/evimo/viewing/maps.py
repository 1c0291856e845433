"""Maps in sensor pixels as pictures of the size of a panel."""

from dataclasses import dataclass
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.events.events import Events
from evimo.viewing.colours import CARD, DEPTH_RANGE, NEGATIVE, POSITIVE, RGB, RULE, Image, depth_index, painted
from evimo.viewing.strokes import polyline

Scalar = TypeVar("Scalar", bound=np.generic)

FILL = 0.55
"""Share of the object's colour inside its mask; the rest is what lies below."""

_LEVELS = (0.62, 0.82, 1.0)
"""Strength of one, two, and three or more events in a pixel."""


@dataclass(frozen=True, slots=True)
class Zoom:
    """From sensor pixels to panel pixels.

    Small sensors are painted as they are and then enlarged; large ones are reduced before they are painted.

    sensor, shown: (height, width) of the map and of the picture.
    """

    sensor: tuple[int, int]
    shown: tuple[int, int]

    @property
    def work(self) -> tuple[int, int]:
        """(height, width) in which pictures are painted."""
        return min(self.sensor, self.shown)

    def reduced(self, values: NDArray[Scalar]) -> NDArray[Scalar]:
        """A map at working size: its nearest pixels."""
        if values.shape[:2] == self.work:
            return values
        rows, columns = [
            ((np.arange(small) + 0.5) * large / small).astype(np.intp)
            for small, large in zip(self.work, self.sensor, strict=True)
        ]
        return values.take(rows, axis=0).take(columns, axis=1)

    def enlarge(self, image: Image, *, into: Image) -> None:
        """Fill a panel with a picture of working size; the edges of pixels stay sharp."""
        cv2.resize(image, self.shown[::-1], dst=into, interpolation=cv2.INTER_AREA)

    def point(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Panel position of sensor positions (..., 2); integers are pixel centres in both."""
        ratio = np.array(self.shown[::-1]) / np.array(self.sensor[::-1])
        return (np.asarray(xy, np.float64) + 0.5) * ratio - 0.5


def polarity_table() -> Image:
    """(256, 3) colours of `event_levels`: red brighter, blue darker."""
    return _table([_faded(colour, level) for colour in (NEGATIVE, POSITIVE) for level in _LEVELS])


def grey_table(white: int) -> Image:
    """(256, 3) greys of `event_levels`, up to this brightness."""
    return _table([_faded((white, white, white), level) for level in _LEVELS * 2])


def event_levels(events: Events, zoom: Zoom) -> NDArray[np.uint8]:
    """Per working pixel 0 without events, else 1 to 3 by their count, plus 3 where the last one was positive."""
    height, width = zoom.work
    inside = (events.x < zoom.sensor[1]) & (events.y < zoom.sensor[0])
    x, y, p = events.x[inside].astype(np.int64), events.y[inside].astype(np.int64), events.p[inside]
    if zoom.work != zoom.sensor:
        x, y = x * width // zoom.sensor[1], y * height // zoom.sensor[0]
    at = y * width + x
    count = np.bincount(at, minlength=height * width)
    levels = np.minimum(count, 3).astype(np.uint8)
    positive = np.zeros(height * width, np.uint8)
    positive[at] = p > 0
    return (levels + 3 * positive).reshape(height, width)


def tinted(image: Image, tint: Image, mask: NDArray[np.bool_]) -> None:
    """Lay the colours of `tint` over the image inside the mask, in place."""
    mixed = cv2.addWeighted(image, 1 - FILL, tint, FILL, 0)
    cv2.copyTo(mixed, mask.view(np.uint8), image)


def depth_picture(
    depth: NDArray[np.float32],
    *,
    known: NDArray[np.bool_],
    table: Image,
    bounds: tuple[float, float] = DEPTH_RANGE,
) -> Image:
    """Depths through the colour table, nearest to farthest between the bounds; depth 1 where not `known`."""
    return painted(depth_index(np.where(known, depth, np.float32(1)), bounds=bounds), table)


def outline(image: Image, mask: NDArray[np.bool_], *, zoom: Zoom, colour: RGB) -> None:
    """Draw the border of a mask of working size on a picture of panel size, in place."""
    ratio = np.array(zoom.shown[::-1]) / np.array(zoom.work[::-1])
    contours, _ = cv2.findContours(mask.view(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    for contour in contours:
        ring = np.concatenate([contour[:, 0], contour[:1, 0]])
        polyline(image, (ring + 0.5) * ratio - 0.5, colour=colour)


def hatch(shape: tuple[int, int]) -> Image:
    """Grey stripes: nothing is known here."""
    rows, columns = np.indices(shape)
    stripe = ((rows + columns) // 3) % 3 == 0
    return np.where(stripe[..., None], np.array(RULE, np.uint8), np.array((36, 40, 48), np.uint8)).astype(np.uint8)


def stripes(shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Thin diagonals, rising where those of `hatch` fall."""
    rows, columns = np.indices(shape)
    return (columns - rows) % 7 < 2


def striped(image: Image, lines: NDArray[np.bool_], *, colour: RGB, mask: NDArray[np.bool_]) -> None:
    """Draw the lines of a panel in one colour where a mask of working size says so, in place."""
    if mask.any():
        inside = cv2.resize(mask.view(np.uint8), image.shape[1::-1], interpolation=cv2.INTER_NEAREST_EXACT)
        cv2.copyTo(np.full_like(image, colour), inside * lines, image)


def hatched(image: Image, stripes: Image, *, unknown: NDArray[np.bool_]) -> None:
    """Lay the stripes over a panel where a mask of working size says so, in place."""
    if unknown.any():
        mask = cv2.resize(unknown.view(np.uint8), image.shape[1::-1], interpolation=cv2.INTER_NEAREST_EXACT)
        cv2.copyTo(stripes, mask, image)


def _table(colours: list[list[int]]) -> Image:
    table = np.full((256, 3), CARD, np.uint8)
    table[1 : 1 + len(colours)] = colours
    return table


def _faded(colour: RGB, level: float) -> list[int]:
    return [round(low + (high - low) * level) for low, high in zip(CARD, colour, strict=True)]
