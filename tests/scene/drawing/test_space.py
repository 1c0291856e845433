import numpy as np
import pytest

from evimo.scene.drawing.furniture import Room
from evimo.scene.drawing.paint import Paint
from evimo.scene.drawing.rooms import furnished
from evimo.scene.drawing.space import Box, around, boxes_of, is_free, stays_inside, stays_on_stage, way_of
from evimo.scene.motion import Motion


def box(x, y, z, half=0.1):
    return Box(np.array([x, y, z], float), np.full(3, half))


@pytest.mark.parametrize(("at", "free"), [(0.15, False), (0.195, True), (0.25, True)])
def test_boxes_meet_when_nearer_than_both_half_sizes(at, free):
    assert is_free(box(at, 0, 0), [box(5, 5, 5), box(0, 0, 0)]) is free


def test_apart_in_one_direction_is_apart():
    assert is_free(box(0.05, 0.05, 0.3), [box(0, 0, 0)])
    assert is_free(box(0, 0, 0), [])


def test_a_way_is_free_only_if_all_of_it_is():
    way = np.array([[1.0, 0, 0], [0.5, 0, 0], [0.1, 0, 0]])
    assert not is_free(Box(way, np.full(3, 0.1)), [box(0, 0, 0)])
    assert is_free(Box(way[:2], np.full(3, 0.1)), [box(0, 0, 0)])


def test_the_box_around_a_way_holds_both_ends():
    held = around(np.array([[0.0, 0, 1], [1.0, -2, 1]]), np.array([0.1, 0.2, 0.3]))
    np.testing.assert_allclose(held.middle, (0.5, -1, 1))
    np.testing.assert_allclose(held.half, (0.6, 1.2, 0.3))


def test_a_way_is_where_something_goes():
    motion = Motion(
        np.array([1.0, 0, 0]), np.eye(3), (lambda t: (np.outer(t, (0, 2, 0)), np.tile((0, 2, 0), (len(t), 1))),)
    )
    way = way_of(motion, 0.5)
    np.testing.assert_allclose(way[0], (1, 0, 0))
    assert way[-1][1] >= 1


@pytest.mark.parametrize(
    ("at", "inside"), [((0, 0, 0.1), True), ((0, 0, 0.05), False), ((1.95, 0, 1), False), ((0, 0, 2.2), False)]
)
def test_walls_floor_and_ceiling_hold_what_stays_inside(bank, at, inside):
    room = Room(np.random.default_rng(0), Paint(bank, 0.5, (1, 2), (0.1, 0.5)), np.array([2.0, 1.5, 1.1]))
    assert stays_inside(np.array([at], float), np.full(3, 0.1), room) is inside


def test_a_stage_ends_where_a_table_does(bank):
    room = Room(np.random.default_rng(0), Paint(bank, 0.5, (1, 2), (0.1, 0.5)), np.array([2.0, 1.5, 1.1]))
    room.stage = np.array([[-0.5, 0.0], [0.5, 1.0]])
    assert stays_on_stage(np.array([[0.4, 0.5, 1], [-0.4, 0.9, 1]]), room)
    assert not stays_on_stage(np.array([[0.4, 0.5, 1], [0.6, 0.9, 1]]), room)


def test_a_table_takes_room_and_what_is_flat_does_not(bank):
    for seed in range(8):
        room = furnished(np.random.default_rng(seed), "table", Paint(bank, 0.5, (1, 2), (0.3, 1)))
        boxes = boxes_of(room)
        middle = room.stage.mean(axis=0)
        assert not is_free(box(*middle, room.support - 0.05), boxes)
        assert all(each.middle[2] + each.half[2] > 0.03 for each in boxes)
        assert max(each.half.max() for each in boxes) < room.half.max()
