import numpy as np
import pytest
from pytest import approx

from evimo.viewing.colours import direction_colours, id_colour
from evimo.viewing.maps import Zoom
from evimo.viewing.objects import described, draw_velocities, inside, label_objects, velocity_table

ZOOM = Zoom(sensor=(180, 240), shown=(360, 480))
BOX = (110, 80, 130, 100)


def white(panel):
    rows, columns = np.nonzero(panel.min(-1) > 200)
    return np.stack([columns, rows], axis=-1)


@pytest.mark.parametrize("direction", [(1, 0), (-1, 0), (0, 1), (0, -1), (0.7, -0.7)])
def test_the_arrow_points_along_the_velocity(make_mark, direction):
    panel = np.zeros((360, 480, 3), np.uint8)
    draw_velocities(panel, [make_mark(1, BOX, (*direction, 0))], zoom=ZOOM, full=1.0)
    start = ZOOM.point(np.array([120.0, 90.0]))
    away = white(panel) - start
    tip = away[np.argmax(np.linalg.norm(away, axis=1))]
    assert tip / np.linalg.norm(tip) == approx(np.array(direction) / np.linalg.norm(direction), abs=0.06)


def test_the_arrow_is_as_long_as_the_speed(make_mark):
    def reach(speed):
        panel = np.zeros((360, 480, 3), np.uint8)
        draw_velocities(panel, [make_mark(1, BOX, (speed, 0, 0))], zoom=ZOOM, full=1.0)
        return white(panel)[:, 0].max() - 240.5

    assert reach(0.8) == approx(2 * reach(0.4), rel=0.05)


def test_a_resting_object_has_no_arrow(make_mark):
    panel = np.zeros((360, 480, 3), np.uint8)
    draw_velocities(panel, [make_mark(1, BOX)], zoom=ZOOM, full=1.0)
    assert len(white(panel)) == 0


@pytest.mark.parametrize(
    ("velocity", "text"), [((0, 0.3, 0.4), "7: 0.50 away"), ((0, 0, -1), "7: 1.00 towards"), ((1, 0, 0.1), "7: 1.00")]
)
def test_convention_plus_z_is_away(make_mark, velocity, text):
    assert described(make_mark(7, BOX, velocity)) == text


def test_arrows_are_moved_into_the_panel():
    start, stop = inside(np.array([2.0, 50.0]), np.array([-60.0, 50.0]), (100, 200))
    assert start.tolist() == [72.0, 50.0] and stop.tolist() == [10.0, 50.0]
    start, stop = inside(np.array([190.0, 95.0]), np.array([230.0, 140.0]), (100, 200))
    assert stop.tolist() == [189.0, 89.0] and (stop - start).tolist() == [40.0, 45.0]


def test_objects_are_painted_by_direction(make_mark):
    table = velocity_table([make_mark(3, BOX, (0, 0.5, 9))], full=0.5)
    assert table[3].tolist() == direction_colours(np.array([0.0, 0.5]), full=0.5).tolist()
    assert table[[0, 1, 2, 4]].max() == 0


def test_every_label_has_the_colour_of_its_id_and_none_hides_another(make_mark):
    objects = [make_mark(k + 1, (100 + 3 * k, 80, 108 + 3 * k, 88)) for k in range(6)]
    panel = np.zeros((360, 480, 3), np.uint8)
    label_objects(panel, objects, zoom=ZOOM)
    areas = [np.count_nonzero(np.all(panel == id_colour(one.id), axis=-1)) for one in objects]
    assert min(areas) > 120
