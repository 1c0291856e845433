import numpy as np
import pytest
from pytest import approx

from evimo.viewing.colours import CARD, depth_table
from evimo.viewing.maps import (
    Zoom,
    depth_picture,
    event_levels,
    grey_table,
    hatch,
    hatched,
    outline,
    polarity_table,
    tinted,
)

SMALL = Zoom(sensor=(3, 4), shown=(3, 4))


def test_levels_count_events_and_keep_the_last_polarity(make_events):
    levels = event_levels(
        make_events((1, 0, 1), (3, 2, -1), (3, 2, -1), (0, 1, -1), (0, 1, -1), (0, 1, 1), (0, 1, 1)), SMALL
    )
    assert levels.tolist() == [[0, 4, 0, 0], [6, 0, 0, 0], [0, 0, 0, 2]]


def test_events_outside_the_sensor_are_left_out(make_events):
    assert event_levels(make_events((4, 0, 1), (0, 3, 1), (65535, 65535, -1)), SMALL).max() == 0


def test_no_events_is_an_empty_picture(make_events):
    assert event_levels(make_events(), SMALL).tolist() == np.zeros((3, 4)).tolist()


def test_a_large_sensor_is_counted_at_panel_size(make_events):
    zoom = Zoom(sensor=(4, 8), shown=(2, 4))
    levels = event_levels(make_events((0, 0, 1), (1, 1, 1), (7, 3, -1)), zoom)
    assert levels.tolist() == [[5, 0, 0, 0], [0, 0, 0, 1]]


def test_reduced_keeps_maps_in_place():
    values = np.repeat(np.repeat(np.arange(6).reshape(2, 3), 4, 0), 4, 1).astype(np.uint8)
    zoom = Zoom(sensor=(8, 12), shown=(2, 3))
    assert zoom.reduced(values).tolist() == [[0, 1, 2], [3, 4, 5]]
    assert Zoom(sensor=(8, 12), shown=(16, 24)).reduced(values) is values


@pytest.mark.parametrize("shown", [(6, 8), (30, 40), (3, 4)])
def test_convention_integers_are_pixel_centres_in_the_panel_too(shown):
    zoom = Zoom(sensor=(3, 4), shown=shown)
    image = np.zeros((3, 4, 3), np.uint8)
    image[1, 2] = 255
    panel = np.zeros((*shown, 3), np.uint8)
    zoom.enlarge(image, into=panel)
    rows, columns = np.nonzero(panel[..., 0])
    assert zoom.point(np.array([2.0, 1.0])).tolist() == approx([columns.mean(), rows.mean()])


def test_red_is_brighter_blue_is_darker_and_more_events_are_stronger():
    table = polarity_table().astype(int)
    assert table[6, 0] > table[6, 2] + 100 and table[3, 2] > table[3, 0] + 100
    assert table[0].tolist() == list(CARD)
    assert np.all(np.diff(grey_table(200).astype(int)[:4].sum(1)) > 0)


def test_tint_leaves_no_trace_outside_the_mask():
    image = np.full((2, 2, 3), 100, np.uint8)
    mask = np.array([[True, False], [False, False]])
    tinted(image, np.full((2, 2, 3), 200, np.uint8), mask=mask)
    assert image[~mask].tolist() == [[100] * 3] * 3
    assert 100 < image[0, 0, 0] < 200


def test_unknown_depth_does_not_matter():
    known = np.array([[True, False]])
    one, other = (
        depth_picture(np.array([[0.5, far]], np.float32), known=known, table=depth_table()) for far in (np.nan, -1.0)
    )
    assert one.tolist() == other.tolist()


def test_hatching_covers_what_is_unknown_only():
    image = np.full((4, 8, 3), 200, np.uint8)
    hatched(image, hatch((4, 8)), unknown=np.array([[True, False], [False, False]]))
    assert np.array_equal(image[:2, :4], hatch((4, 8))[:2, :4])
    assert np.all(image[2:] == 200) and np.all(image[:, 4:] == 200)


def test_outline_follows_the_border():
    zoom = Zoom(sensor=(20, 20), shown=(80, 80))
    mask = np.zeros((20, 20), bool)
    mask[5:15, 5:15] = True
    image = np.zeros((80, 80, 3), np.uint8)
    outline(image, mask, zoom=zoom, colour=(255, 0, 0))
    rows, columns = np.nonzero(image[..., 0] > 128)
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == approx((21, 58, 21, 58), abs=2)
    assert image[30:50, 30:50].max() == 0
