from itertools import combinations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evimo.viewing.layout import Box, layout_of

SENSORS = [(260, 346), (180, 190), (180, 240), (480, 640), (720, 1280), (128, 128), (346, 260)]


@settings(deadline=None)
@given(size=st.tuples(st.integers(60, 1500), st.integers(60, 1500)))
def test_every_frame_is_even_and_fits_a_screen(size):
    height, width = layout_of(size).frame
    assert height % 2 == width % 2 == 0
    assert height <= 962 and width <= 1280


@settings(deadline=None)
@given(size=st.tuples(st.integers(60, 1500), st.integers(60, 1500)))
def test_six_panels_fit_a_large_screen_and_one_a_small_one(size):
    height, width = layout_of(size, rows=2, columns=3).frame
    assert height <= 962 and width <= 1790
    height, width = layout_of(size, rows=1, columns=1).frame
    assert height <= 962 and width <= 1280


@pytest.mark.parametrize("grid", [(2, 2), (2, 3), (1, 1)])
@pytest.mark.parametrize("size", SENSORS)
def test_nothing_overlaps_and_nothing_leaves_the_frame(size, grid):
    rows, columns = grid
    layout = layout_of(size, rows=rows, columns=columns)
    assert len(layout.images) == len(layout.headers) == rows * columns
    boxes = [*layout.images, *layout.headers, layout.sidebar]
    assert all(one.overlap(other) == 0 for one, other in combinations(boxes, 2))
    height, width = layout.frame
    assert all(box.x >= 0 and box.y >= 0 and box.right <= width and box.bottom <= height for box in boxes)


@pytest.mark.parametrize("size", SENSORS)
def test_pixels_stay_square(size):
    image = layout_of(size).images[0]
    assert abs(image.width / size[1] - image.height / size[0]) < 1.5 / min(size)


def test_small_sensors_are_enlarged_by_whole_or_half_steps():
    assert layout_of((180, 240)).scale == 2.0
    assert layout_of((480, 640)).scale < 1


def test_overlap_counts_shared_pixels():
    assert Box(0, 0, 4, 4).overlap(Box(2, 3, 4, 4)) == 2
    assert Box(0, 0, 4, 4).overlap(Box(4, 0, 4, 4)) == 0


def test_distance_is_the_way_between_boxes():
    assert Box(0, 0, 4, 4).distance(Box(6, 7, 4, 4)) == 5
    assert Box(6, 7, 4, 4).distance(Box(0, 0, 4, 4)) == 5
    assert Box(0, 0, 4, 4).distance(Box(3, 4, 4, 4)) == 0
