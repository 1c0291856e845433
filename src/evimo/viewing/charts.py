"""Still charts: curves and bands over two axes, and dots beside a range on a scale of ratios."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.viewing.colours import CARD, INK, MUTED, RGB, RULE, Image
from evimo.viewing.layout import Box
from evimo.viewing.strokes import SMALL, TITLE, polyline, swatch, text_width, write

F8 = NDArray[np.float64]

_LEFT, _TOP, _RIGHT, _BOTTOM = 62, 40, 18, 52
_NAMES = 190
"""Columns for the names of the rows of `draw_ratios`."""
_RULER: RGB = (38, 42, 50)
_LARGEST_RATIO = 16.0


@dataclass(frozen=True, slots=True)
class Axis:
    """What a side of a chart shows, from low to high; ticks at these values, as fractions below 1 if wanted.

    Logarithmic axes must be positive.
    """

    name: str
    low: float
    high: float
    ticks: tuple[float, ...]
    log: bool = False
    fractions: bool = False

    def tick_name(self, tick: float) -> str:
        """As written beside it."""
        return f"1/{1 / tick:g}" if self.fractions and 0 < tick < 1 else f"{tick:g}"

    def share(self, values: F8 | float) -> F8:
        """Where values lie, 0 at low and 1 at high, clipped."""
        low, high = self.low, self.high
        at = np.asarray(values, np.float64)
        if self.log:
            low, high, at = np.log(low), np.log(high), np.log(np.maximum(at, low))
        return np.clip((at - low) / (high - low), 0, 1)


_RATIOS = Axis(
    "over the middle of the range; beyond 16 times at the border",
    1 / _LARGEST_RATIO,
    _LARGEST_RATIO,
    tuple(2.0**power for power in range(-4, 5)),
    log=True,
    fractions=True,
)


@dataclass(frozen=True, slots=True)
class Curve:
    """Points (N,) joined by a line, with a name for the legend; `low` and `high` (N,) add a band around them."""

    name: str
    x: F8
    y: F8
    colour: RGB
    low: F8 | None = None
    high: F8 | None = None


@dataclass(frozen=True, slots=True)
class RatioRow:
    """A range of positive numbers, the wider one that is still allowed, and dots, the median's larger; bad is brighter.

    All are shown as ratios to the (geometric) middle of the range.
    """

    name: str
    low: float
    high: float
    dots: Sequence[float]
    allowed: tuple[float, float] | None = None
    median: float | None = None
    bad: bool = False


def draw_curves(image: Image, box: Box, title: str, *, axes: tuple[Axis, Axis], curves: Sequence[Curve]) -> None:
    """Curves over a horizontal and a vertical axis, the later over the earlier, in place."""
    area = _framed(image, box, title, left=_LEFT)
    across, up = axes
    _ticks_across(image, area, across)
    for tick in up.ticks:
        row = round(area.bottom - 1 - float(up.share(tick)) * (area.height - 1))
        image[row, area.x : area.right] = _RULER
        write(image, f"{tick:g}", (area.x - 8, row), size=SMALL, colour=MUTED, align="right")
    for curve in curves:
        if curve.low is not None and curve.high is not None:
            ring = np.concatenate(
                (_points(area, axes, curve.x, curve.low), _points(area, axes, curve.x, curve.high)[::-1])
            )
            _fill(image, ring, curve.colour)
    for curve in curves:
        polyline(image, _points(area, axes, curve.x, curve.y), colour=curve.colour)
    x = box.right - 14 - sum(text_width(curve.name, size=SMALL) + 30 for curve in curves if curve.name)
    for curve in curves:
        if curve.name:
            x = write(
                image,
                curve.name,
                (swatch(image, (x, box.y + 20), fill=curve.colour), box.y + 20),
                size=SMALL,
                colour=MUTED,
            )
            x += 14


def draw_ratios(image: Image, box: Box, title: str, *, rows: Sequence[RatioRow], colours: tuple[RGB, RGB]) -> None:
    """One line for each row: the range in the first colour, the allowed one thinner, dots in the second, in place."""
    area = _framed(image, box, title, left=_NAMES)
    _ticks_across(image, area, _RATIOS)
    for number, row in enumerate(rows):
        y = round(area.y + (number + 0.5) * area.height / len(rows))
        write(image, row.name, (area.x - 10, y), size=SMALL, colour=INK if row.bad else MUTED, align="right")
        middle = np.sqrt(row.low * row.high)
        for ends, half in ((row.allowed, 2), ((row.low, row.high), 6)):
            if ends is not None:
                left, right = _columns(area, _RATIOS, np.array(ends) / middle)
                cv2.rectangle(image, (left - 1, y - half), (right + 1, y + half), colours[0], -1)
        for column in _columns(area, _RATIOS, np.array(row.dots) / middle):
            cv2.circle(image, (column, y), 3, colours[1], 1, cv2.LINE_AA)
        if row.median is not None:
            cv2.circle(
                image, (_columns(area, _RATIOS, np.array([row.median / middle]))[0], y), 6, colours[1], -1, cv2.LINE_AA
            )


def _framed(image: Image, box: Box, title: str, *, left: int) -> Box:
    """The card and its title; the area that is left for the marks."""
    box.of(image)[:] = CARD
    write(image, title, (box.x + 14, box.y + 20), size=TITLE, bold=True)
    return Box(box.x + left, box.y + _TOP, box.width - left - _RIGHT, box.height - _TOP - _BOTTOM)


def _ticks_across(image: Image, area: Box, axis: Axis) -> None:
    for tick, column in zip(axis.ticks, _columns(area, axis, np.array(axis.ticks)), strict=True):
        image[area.y : area.bottom, column] = RULE if tick == 1 else _RULER
        write(image, axis.tick_name(tick), (column, area.bottom + 12), size=SMALL, colour=MUTED, align="centre")
    write(image, axis.name, (area.x + area.width / 2, area.bottom + 34), size=SMALL, colour=MUTED, align="centre")


def _columns(area: Box, axis: Axis, values: F8) -> list[int]:
    return np.rint(area.x + axis.share(values) * (area.width - 1)).astype(int).tolist()


def _points(area: Box, axes: tuple[Axis, Axis], x: F8, y: F8) -> F8:
    """(N, 2) in px."""
    across, up = axes
    return np.stack(
        (area.x + across.share(x) * (area.width - 1), area.bottom - 1 - up.share(y) * (area.height - 1)), axis=1
    )


def _fill(image: Image, ring: F8, colour: RGB, *, strength: float = 0.25) -> None:
    """A transparent polygon."""
    over = image.copy()
    cv2.fillPoly(over, [np.rint(ring).astype(np.int32)], colour, cv2.LINE_AA)
    cv2.addWeighted(over, strength, image, 1 - strength, 0, dst=image)
