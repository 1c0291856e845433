"""What all frames of a video share: boxes for one sensor, a painter for them, and the parts that never change."""

import numpy as np

from evimo.errors import BadInput
from evimo.viewing.colours import BACKDROP, CARD, Image
from evimo.viewing.layout import layout_of
from evimo.viewing.maps import Zoom
from evimo.viewing.objects import LONGEST_ARROW
from evimo.viewing.painter import Painter
from evimo.viewing.sidebar import Sidebar


class Frame:
    """An empty frame for a sensor of (height, width), to be completed once by legends and copied for each slice.

    Raises:
        BadInput: the size is not positive.
    """

    def __init__(self, size: tuple[int, int], *, rows: int = 2, columns: int = 2) -> None:
        if min(size) < 1:
            raise BadInput(
                f"a sensor of {size[1]}x{size[0]} px cannot be drawn", fix="give (height, width), both positive"
            )
        self.layout = layout_of(size, rows=rows, columns=columns)
        self.painter = Painter(Zoom(sensor=size, shown=(self.layout.images[0].height, self.layout.images[0].width)))
        self.empty = np.full((*self.layout.frame, 3), BACKDROP, np.uint8)
        for box in self.layout.images:
            box.of(self.empty)[:] = CARD

    def sidebar(self, *, unit: str = "mean depths/s", coloured: str = "Object velocity") -> Sidebar:
        """A side bar for this frame, its fixed parts drawn."""
        longest = LONGEST_ARROW * self.painter.zoom.shown[1]
        sidebar = Sidebar(self.layout.sidebar, longest_arrow=longest, unit=unit, coloured=coloured)
        sidebar.prepare(self.empty)
        return sidebar

    def panels(self, image: Image) -> list[Image]:
        """The sensor images in a copy of the frame, as views."""
        return [box.of(image) for box in self.layout.images]

    def check(self, size: tuple[int, ...]) -> None:
        """Refuse maps of another size than the sensor's.

        Raises:
            BadInput: it is another.
        """
        sensor = self.painter.zoom.sensor
        if size != sensor:
            shapes = [f"{shape[1]}x{shape[0]}" for shape in (size, sensor)]
            raise BadInput(
                f"maps of {shapes[0]} px for panels of {shapes[1]} px", fix="make Panels of the recording's sensor size"
            )
