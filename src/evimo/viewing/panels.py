"""One frame of the video: events, moving objects, depth, velocity and camera motion of one slice."""

import numpy as np
from numpy.typing import NDArray

from evimo.events.events import Events
from evimo.recordings.estimate import Estimate
from evimo.viewing.colours import Image
from evimo.viewing.frame import Frame
from evimo.viewing.history import History
from evimo.viewing.legends import titles
from evimo.viewing.maps import event_levels
from evimo.viewing.moment import estimated


class Panels:
    """Draws estimates of one sensor, slice after slice; it remembers two seconds of motion for the plots.

    Args:
        size: (height, width) of the sensor.

    Raises:
        BadInput: the size is not positive.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self._frame = Frame(size)
        titles(self._frame.empty, self._frame.layout)
        self._sidebar = self._frame.sidebar()
        self._history = History()

    @property
    def frame(self) -> tuple[int, int]:
        """(height, width) of every drawn frame, even."""
        return self._frame.layout.frame

    def draw(self, estimate: Estimate, events: Events, *, time_origin_us: int) -> Image:
        """Draw one slice.

        Args:
            estimate: maps in sensor pixels, of the size given at the start.
            events: those of the slice; events outside the sensor are left out.
            time_origin_us: absolute time shown as 0 s.

        Returns:
            (height, width, 3) uint8 RGB, a new array.

        Raises:
            BadInput: the maps have another size than the sensor.
        """
        self._frame.check(estimate.rel_depth.shape)
        moment, painter = estimated(estimate), self._frame.painter
        self._history.add(moment)
        image = self._frame.empty.copy()
        events_panel, mask, depth, velocity = self._frame.panels(image)
        levels, valid = event_levels(events, painter.zoom), estimate.valid
        ids, moving, known = _masks(estimate)
        painter.events(events_panel, levels)
        painter.mask(mask, levels, ids=ids, moving=moving, valid=known)
        painter.outlines(mask, ids, moment.marks)
        painter.labels(mask, moment.marks)
        painter.depth(depth, estimate.rel_depth, valid=valid)
        full = self._history.speed_limit
        painter.velocity(velocity, levels, moment.marks, ids=ids, valid=known, full=full)
        self._sidebar.draw(image, moment, events=len(events), history=self._history, time_origin_us=time_origin_us)
        return image


def _masks(estimate: Estimate) -> tuple[NDArray[np.uint8], NDArray[np.bool_], NDArray[np.bool_]]:
    """Ids, what moves, and where both are known; that is nowhere if the model does not estimate them."""
    if estimate.ids is None or estimate.moving is None:
        nothing = np.zeros(estimate.valid.shape, np.bool_)
        return nothing.view(np.uint8), nothing, nothing
    return estimate.ids, estimate.moving, estimate.valid
