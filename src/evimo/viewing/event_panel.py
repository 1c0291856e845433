"""One frame of a recording that holds nothing but events."""

from evimo.events.slices import Slice
from evimo.viewing import legends
from evimo.viewing.colours import MUTED, Image
from evimo.viewing.frame import Frame
from evimo.viewing.maps import event_levels
from evimo.viewing.strokes import write

GAP = 18


class EventPanel:
    """Draws the events of one sensor, slice after slice.

    Args:
        size: (height, width) of the sensor.

    Raises:
        BadInput: the size is not positive.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self._frame = Frame(size, rows=1, columns=1)
        (self._header,) = self._frame.layout.headers
        self._title_end = legends.title(self._frame.empty, self._header, "Events")
        legends.polarities(self._frame.empty, self._header)

    def draw(self, part: Slice, *, time_origin_us: int) -> Image:
        """Draw one slice.

        Args:
            part: its events; those outside the sensor are left out.
            time_origin_us: absolute time shown as 0 s.

        Returns:
            (height, width, 3) uint8 RGB, a new array.
        """
        image = self._frame.empty.copy()
        (panel,) = self._frame.panels(image)
        self._frame.painter.events(panel, event_levels(part.events, self._frame.painter.zoom))
        row = self._header.y + 16
        time_s, length_ms = (part.centre_us - time_origin_us) / 1e6, (part.stop_us - part.start_us) / 1e3
        x = write(image, f"{time_s:.3f} s", (self._title_end + GAP, row), bold=True)
        count = f"{len(part.events):,}".replace(",", " ")
        write(image, f"{count} events in {length_ms:g} ms", (x + GAP, row), colour=MUTED)
        return image
