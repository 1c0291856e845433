"""The side bar: time, camera motion, and what colours and arrows of velocities mean."""

import numpy as np

from evimo.viewing.colours import CARD, MUTED, RULE, X_AXIS, Y_AXIS, Z_AXIS, Image
from evimo.viewing.history import History, plot
from evimo.viewing.layout import Box
from evimo.viewing.legends import depth_signs, wheel
from evimo.viewing.moment import Moment
from evimo.viewing.strokes import TITLE, arrow, write

_PAD = 14
_STATUS = 92
_LEGEND = 212


class Sidebar:
    """Draws into one box of the frame; the parts that never change are drawn once by `prepare`.

    `longest_arrow`: length in px of the arrow of the speed limit. `unit`: of velocities. `coloured`: what the colours
    of directions speak of.
    """

    def __init__(
        self, box: Box, *, longest_arrow: float, unit: str = "mean depths/s", coloured: str = "Object velocity"
    ) -> None:
        self._box, self._longest, self._unit, self._coloured = box, longest_arrow, unit, coloured
        left, width = box.x + _PAD, box.width - 2 * _PAD
        self._status = Box(left, box.y + 8, width, _STATUS)
        self._legend = Box(left, box.bottom - _LEGEND, width, _LEGEND)
        motion = Box(left, self._status.bottom + 6, width, self._legend.y - self._status.bottom - 16)
        self._motion_title = Box(motion.x, motion.y, width, 44)
        height = (motion.height - 44) // 2
        self._plots = [Box(motion.x, motion.y + 44 + row * height + 26, width, height - 34) for row in (0, 1)]

    def prepare(self, image: Image) -> None:
        """Titles and legends, in place."""
        self._box.of(image)[:] = CARD
        self._title(image, "Camera motion", self._motion_title.y)
        x, y = self._motion_title.x, self._motion_title.y + 35
        for name, colour in (("x right", X_AXIS), ("y down", Y_AXIS), ("z forward", Z_AXIS)):
            x = write(image, name, (x, y), colour=colour) + 14
        for box, name in zip(self._plots, (f"translation, {self._unit}", "rotation, rad/s"), strict=True):
            write(image, name, (box.x, box.y - 12), colour=MUTED)
        self._title(image, self._coloured, self._legend.y)
        wheel(image, Box(self._legend.x, self._legend.y + 28, self._legend.width, 124))
        depth_signs(image, (self._legend.x, self._legend.bottom - 18))

    def draw(self, image: Image, moment: Moment, *, events: int, history: History, time_origin_us: int) -> None:
        """What changes from slice to slice, in place."""
        time_s = (moment.t_us - time_origin_us) / 1e6
        length_us = moment.stop_us - moment.start_us
        x, y = self._status.x, self._status.y
        write(image, f"{time_s:.3f} s", (x, y + 16), size=0.85, bold=True)
        write(image, moment.headline, (x, y + 43))
        write(image, f"{events:,} events".replace(",", " "), (x, y + 62), colour=MUTED)
        write(
            image, f"slice {length_us / 1e3:g} ms, {1e6 / max(length_us, 1):.0f} per second", (x, y + 81), colour=MUTED
        )
        for box, values in zip(self._plots, (history.twists[:, :3], history.twists[:, 3:]), strict=True):
            plot(image, box, history.ages_s, values)
        self._scale(image, history.speed_limit)

    def _scale(self, image: Image, full: float) -> None:
        y = self._legend.bottom - 44
        start = np.array([self._legend.x + 1.0, y])
        stop = start + (self._longest / 2, 0)
        arrow(image, start, stop)
        write(image, f"{full / 2:g} {self._unit}", (stop[0] + 10, y), colour=MUTED)

    def _title(self, image: Image, name: str, y: int) -> None:
        image[y, self._box.x + _PAD : self._box.right - _PAD] = RULE
        write(image, name, (self._box.x + _PAD, y + 15), size=TITLE, bold=True)
