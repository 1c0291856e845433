"""The last two seconds of camera motion, and plots of them."""

from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from evimo.viewing.colours import CARD, MUTED, RULE, X_AXIS, Y_AXIS, Z_AXIS, Image
from evimo.viewing.layout import Box
from evimo.viewing.moment import Moment
from evimo.viewing.strokes import PLAIN, SMALL, polyline, write

SPAN_US = 2_000_000
FLOW_STEPS = (1, 1.5, 2, 3, 4, 6, 8)
"""Finer than those of arrows: colours pale when the scale is too long."""

AXES = (("x", X_AXIS), ("y", Y_AXIS), ("z", Z_AXIS))


class History:
    """Camera twists and speeds of the last two seconds; it starts anew when time jumps back."""

    def __init__(self) -> None:
        self._rows: deque[tuple[int, NDArray[np.float64], float, float]] = deque()

    def add(self, moment: Moment, *, flow_px: float = 0.0) -> None:
        """Append one moment, with the speed of its flow in px/s, and forget what is older than two seconds."""
        if self._rows and moment.t_us <= self._rows[-1][0]:
            self._rows.clear()
        speeds = [float(np.linalg.norm(mark.velocity)) for mark in moment.marks]
        self._rows.append((moment.t_us, moment.ego, max(speeds, default=0.0), flow_px))
        while self._rows[0][0] < moment.t_us - SPAN_US:
            self._rows.popleft()

    @property
    def ages_s(self) -> NDArray[np.float64]:
        """(N,) seconds before the last moment, 0 for itself."""
        times_us = np.array([row[0] for row in self._rows], np.int64)
        return (times_us[-1] - times_us) / 1e6

    @property
    def twists(self) -> NDArray[np.float64]:
        """(N, 6), as `Moment.ego`."""
        return np.array([row[1] for row in self._rows])

    @property
    def speed_limit(self) -> float:
        """The speed of the longest arrow, in lengths per second: the fastest object's, rounded up."""
        return round_limit(max(row[2] for row in self._rows))

    @property
    def flow_limit(self) -> float:
        """The flow of the purest colours, in px/s: the fastest, rounded up."""
        return round_limit(max(row[3] for row in self._rows), least=10, steps=FLOW_STEPS)


def round_limit(value: float, *, least: float = 0.1, steps: Sequence[float] = (1, 2, 5)) -> float:
    """The smallest of 1, 2, 5 x 10^k that is not below value, so that scales change seldom."""
    value = max(value, least)
    power = 10.0 ** np.floor(np.log10(value))
    return next(float(step * power) for step in (*steps, 10) if step * power >= value * (1 - 1e-9))


def plot(image: Image, box: Box, ages_s: NDArray[np.float64], values: NDArray[np.float64]) -> None:
    """Three signed curves (N, 3) over the last two seconds, the present at the right, in place.

    The legend below names the axes and their present values.
    """
    limit = round_limit(float(np.abs(values).max(initial=0)))
    area = Box(box.x + 40, box.y, box.width - 46, box.height - 38)
    _rulers(image, area, limit)
    middle, half = area.y + (area.height - 1) / 2, (area.height - 1) / 2 - 2
    columns = area.right - 1 - ages_s / (SPAN_US / 1e6) * (area.width - 1)
    for axis, (_, colour) in enumerate(AXES):
        points = np.stack([columns, middle - values[:, axis] / limit * half], axis=1)
        polyline(image, points, colour=colour)
    for axis, (name, colour) in enumerate(AXES):
        at = box.x + axis * (box.width / 3), box.bottom - 8
        behind = write(image, name, at, colour=colour, bold=True)
        value = float(values[-1, axis])
        number = f"{value:+.2f}" if abs(value) < 100 else f"{value:+.0f}"
        write(image, number, (behind + 5, at[1]), size=PLAIN, colour=colour)


def _rulers(image: Image, area: Box, limit: float) -> None:
    area.of(image)[:] = [channel // 2 for channel in CARD]
    for share, name in ((0.0, f"+{limit:g}"), (0.5, "0"), (1.0, f"-{limit:g}")):
        row = area.y + round(share * (area.height - 1))
        image[row, area.x : area.right] = RULE
        inside = min(max(row, area.y + 5), area.bottom - 6)
        write(image, name, (area.x - 6, inside), size=SMALL, colour=MUTED, align="right")
    for share, name in ((0.0, "-2 s"), (0.5, "-1 s"), (1.0, "now")):
        column = area.x + round(share * (area.width - 1))
        image[area.y : area.bottom, column] = RULE
        align = "left" if share == 0 else "centre" if share < 1 else "right"
        write(image, name, (column, area.bottom + 9), size=SMALL, colour=MUTED, align=align)
