"""The events of each slice, as the camera's picture."""

from evimo.events.slices import Slice
from evimo.viewing.maps import Zoom, event_levels, polarity_table
from evimo.viewing.window.entities import EVENTS
from evimo.viewing.window.store import Store

LABELS = ("darker", "darker, 2", "darker, 3 or more", "brighter", "brighter, 2", "brighter, 3 or more")


class EventLayer:
    """Draws the events of one sensor (height, width): red brighter, blue darker."""

    def __init__(self, size: tuple[int, int]) -> None:
        self._zoom = Zoom(sensor=size, shown=size)

    def start(self, store: Store) -> None:
        """Log what holds at all times: the colours."""
        rows = polarity_table()[: len(LABELS) + 1].tolist()
        classes = [store.rr.AnnotationInfo(0, "no event", (0, 0, 0, 0))]
        classes += [store.rr.AnnotationInfo(k, name, rows[k]) for k, name in enumerate(LABELS, start=1)]
        store.log_always(EVENTS, store.rr.AnnotationContext(classes))

    def draw(self, store: Store, part: Slice) -> None:
        """Log one slice, at its centre."""
        levels = event_levels(part.events, self._zoom)
        store.log(EVENTS, store.rr.SegmentationImage(levels, opacity=1.0), t_us=part.centre_us)
