"""Where everything is: panels in rows and columns, a side bar to their right."""

from dataclasses import dataclass
from typing import NamedTuple

from evimo.viewing.colours import Image

GAP = 12
HEADER = 34
SIDEBAR = 252
_LARGEST = (856, 980)
"""Height and width of the images of two rows and two columns together."""
_SMALLEST_CELL = (278, 372)
_SMALLEST_ALONE = (278, 660)
"""Where there is no side bar the title bar tells more."""


class Box(NamedTuple):
    """A rectangle of the frame in px; the right column and the bottom row are not part of it."""

    x: int
    y: int
    width: int
    height: int

    @property
    def right(self) -> int:
        """First column to its right."""
        return self.x + self.width

    @property
    def bottom(self) -> int:
        """First row below it."""
        return self.y + self.height

    def of(self, image: Image) -> Image:
        """The part of the image inside the box, as a view."""
        return image[self.y : self.bottom, self.x : self.right]

    def distance(self, other: "Box") -> int:
        """Columns and rows between two boxes, 0 where they touch."""
        across = max(other.x - self.right, self.x - other.right, 0)
        return across + max(other.y - self.bottom, self.y - other.bottom, 0)

    def overlap(self, other: "Box") -> int:
        """Pixels that two boxes share."""
        width = min(self.right, other.right) - max(self.x, other.x)
        height = min(self.bottom, other.bottom) - max(self.y, other.y)
        return max(width, 0) * max(height, 0)


@dataclass(frozen=True, slots=True)
class Layout:
    """Boxes of one frame.

    frame:   (height, width), even.
    scale:   frame px per sensor px, the same in x and y up to rounding.
    images:  the sensor images, row by row; for estimates events, mask, depth, velocity.
    headers: the title bars above them.
    sidebar: time, camera motion and the legend of velocities; a single image has none, it is of no width.
    """

    frame: tuple[int, int]
    scale: float
    images: tuple[Box, ...]
    headers: tuple[Box, ...]
    sidebar: Box


def layout_of(size: tuple[int, int], *, rows: int = 2, columns: int = 2) -> Layout:
    """The layout for a sensor of this (height, width), small sensors enlarged.

    Two columns are at most 1280 x 960, three 1790 x 960.
    """
    height, width = size
    scale = min(_LARGEST[0] // rows / height, _LARGEST[1] // min(columns, 2) / width)
    scale = int(scale * 2) / 2 if scale >= 2 else scale
    shown = max(round(height * scale), 1), max(round(width * scale), 1)
    smallest, sidebar_width = (_SMALLEST_ALONE, 0) if rows == columns == 1 else (_SMALLEST_CELL, SIDEBAR)
    cell = max(shown[0], smallest[0]), max(shown[1], smallest[1])

    corners = [
        (GAP + column * (cell[1] + GAP), GAP + row * (cell[0] + HEADER + GAP))
        for row in range(rows)
        for column in range(columns)
    ]
    headers = [Box(x, y, cell[1], HEADER) for x, y in corners]
    images = [
        Box(x + (cell[1] - shown[1]) // 2, y + HEADER + (cell[0] - shown[0]) // 2, shown[1], shown[0])
        for x, y in corners
    ]
    right, bottom = headers[-1].right, headers[-1].bottom + cell[0]
    sidebar = Box(right + GAP if sidebar_width else right, GAP, sidebar_width, bottom - GAP)
    frame = _even(bottom + GAP), _even(sidebar.right + GAP)
    return Layout(frame, scale, (*images,), (*headers,), sidebar)


def _even(length: int) -> int:
    return length + length % 2
