import numpy as np
import pytest
from pytest import approx

from evimo.viewing.layout import Box
from evimo.viewing.strokes import arrow, chip, free_place, polyline, swatch, text_width, write, z_sign


@pytest.fixture
def image():
    return np.zeros((120, 200, 3), np.uint8)


def ink(image):
    """Box of what was drawn: first and last column, first and last row."""
    rows, columns = np.nonzero(image.max(-1) > 60)
    return columns.min(), columns.max(), rows.min(), rows.max()


@pytest.mark.parametrize(("align", "first"), [("left", 100), ("centre", 60), ("right", 20)])
def test_text_is_aligned_and_as_wide_as_said(image, align, first):
    width = text_width("HHHHHHHH", bold=True)
    behind = write(image, "HHHHHHHH", (100, 50), bold=True, align=align)
    left, right, top, bottom = ink(image)
    start = {"left": 100, "centre": 100 - width / 2, "right": 100 - width}[align]
    assert (left, right) == approx((start, start + width), abs=3)
    assert behind == approx(start + width, abs=1)
    assert (top + bottom) / 2 == approx(50, abs=1.5)


def test_swatch_shows_its_fill(image):
    behind = swatch(image, (10, 50), fill=(1, 200, 3))
    assert np.count_nonzero(np.all(image == (1, 200, 3), axis=-1)) == 121
    assert behind == 26


def test_chip_stays_in_its_box(image):
    chip(image, "12", Box(20, 30, 40, 18), colour=(250, 240, 60))
    assert ink(image) == (20, 59, 30, 47)
    assert image[30:48, 20:60].min() < 60  # dark letters


@pytest.mark.parametrize("stop", [(150, 60), (50, 60), (100, 110), (100, 10)])
def test_the_head_of_an_arrow_is_at_its_end(image, stop):
    start, stop = np.array([100.0, 60.0]), np.array(stop, float)
    arrow(image, start, stop)
    rows, columns = np.nonzero(image.min(-1) > 200)
    along = (np.stack([columns, rows], -1) - start) @ (stop - start) / 50
    across = (np.stack([columns, rows], -1) - start) @ ((stop - start)[::-1] * (1, -1)) / 50
    assert along.min() == approx(0, abs=3) and along.max() == approx(50, abs=3)
    assert np.abs(across[along > 38]).max() > np.abs(across[along < 30]).max() + 2


def test_towards_has_a_dot_and_away_a_cross(image):
    z_sign(image, np.array([40.0, 60.0]), towards=True)
    z_sign(image, np.array([140.0, 60.0]), towards=False)
    dot, cross = image[52:69, 32:49, 0], image[52:69, 132:149, 0]
    assert dot[8, 8] > 200 and cross[8, 8] > 150
    assert dot[4, 4] < 60 and cross[4, 4] > 100


def test_polyline_reaches_its_points(image):
    polyline(image, np.array([[10.0, 100.0], [190.0, 20.0]]), colour=(255, 255, 255))
    assert ink(image) == approx((10, 190, 20, 100), abs=2)


def test_a_label_goes_above_then_below_then_beside():
    around, where = Box(80, 50, 20, 20), (120, 200)
    above = free_place((18, 40), around=around, inside=where, taken=[])
    below = free_place((18, 40), around=around, inside=where, taken=[above])
    beside = free_place((18, 40), around=around, inside=where, taken=[above, below])
    assert above.bottom <= around.y and below.y >= around.bottom and beside.x >= around.right


def test_a_label_sits_amid_a_large_object():
    around = Box(40, 20, 100, 80)
    place = free_place((18, 20), around=around, inside=(120, 200), taken=[])
    assert (place.x + place.width / 2, place.y + place.height / 2) == approx((90, 60), abs=1)


@pytest.mark.parametrize("corner", [(0, 0), (195, 0), (0, 115), (195, 115)])
def test_a_label_is_never_cut_off(corner):
    place = free_place((18, 60), around=Box(*corner, 5, 5), inside=(120, 200), taken=[])
    assert place.x >= 0 and place.y >= 0 and place.right <= 200 and place.bottom <= 120


def test_a_label_without_room_covers_least():
    wall, part = Box(0, 0, 200, 118), Box(0, 0, 200, 120)
    place = free_place((18, 40), around=Box(80, 50, 20, 20), inside=(120, 200), taken=[wall, part])
    assert place.right <= 200 and place.bottom <= 120
