"""Charts put marks where their numbers are."""

import numpy as np
import pytest
from pytest import approx

from evimo.viewing.charts import Axis, Curve, RatioRow, draw_curves, draw_ratios
from evimo.viewing.layout import Box

RED, BLUE = (250, 0, 0), (0, 0, 250)
BOX = Box(10, 20, 600, 400)


@pytest.fixture
def image() -> np.ndarray:
    return np.zeros((440, 620, 3), np.uint8)


def places(image: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """(N, 2) columns and rows of pixels of nearly that colour, below the title."""
    rows, columns = np.nonzero(np.abs(image - np.array(colour)).max(axis=-1) < 120)
    return np.stack((columns, rows), axis=1)[rows > BOX.y + 40]


def test_axes_clip_and_count_in_logarithms():
    assert Axis("", 0, 4, ()).share(np.array([-1, 0, 1, 9])) == approx([0, 0, 0.25, 1])
    assert Axis("", 0.1, 1000, (), log=True).share(np.array([0, 0.1, 10, 1e4])) == approx([0, 0, 0.5, 1])


def test_ticks_below_one_are_fractions_where_wanted():
    assert Axis("", 0.1, 16, (), fractions=True).tick_name(0.125) == "1/8"
    assert Axis("", 0.1, 16, ()).tick_name(0.125) == "0.125"


def test_a_curve_rises_to_the_right_and_a_band_lies_around_it(image):
    axes = Axis("across", 0, 1, (0.0, 1.0)), Axis("up", 0, 1, (0.0, 1.0))
    x = np.array([0.0, 1.0])
    flat = Curve("", x, np.array([0.5, 0.5]), BLUE)
    rising = Curve("rising", x, np.array([0.25, 0.75]), RED, np.array([0.0, 0.5]), np.array([0.5, 1.0]))
    draw_curves(image, BOX, "title", axes=axes, curves=[rising, flat])
    line, level = places(image, RED), places(image, BLUE)
    first, last = line[line[:, 0].argmin()], line[line[:, 0].argmax()]
    middle = level[:, 1].mean()
    assert first[1] - middle == approx(middle - last[1], abs=2)
    assert first[1] > last[1]
    card, above = image[BOX.y + 45, BOX.right - 30], image[round(last[1]) - 20, last[0] - 5]
    assert above[0] > image[BOX.y + 45, BOX.x + 80, 0]  # the band reddens what is above the end of the curve
    assert card[0] > above[0] * 0.5


def test_ratios_are_over_the_middle_and_stop_at_the_border(image):
    row = RatioRow("name", 1.0, 4.0, [2.0, 1e6], allowed=(0.5, 8.0), median=4.0, bad=True)
    draw_ratios(image, BOX, "title", rows=[row], colours=(BLUE, RED))
    dots, bar = places(image, RED)[:, 0], places(image, BLUE)[:, 0]
    left, right = 200, BOX.right - 18 - 1  # of the area: ratios 1/16 and 16
    octave = (right - left) / 8
    assert dots.max() == approx(right, abs=4)
    assert np.abs(dots - (left + 5 * octave)).min() <= 1  # the median: twice the middle, 2
    assert (bar.min(), bar.max()) == approx((left + 2 * octave, left + 6 * octave), abs=3)
