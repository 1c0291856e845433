import cv2
import numpy as np
import pytest
from pytest import approx

from evimo.viewing.colours import (
    NEGATIVE,
    OBJECTS,
    POSITIVE,
    depth_index,
    depth_table,
    direction_colours,
    id_colour,
    id_table,
    painted,
)

DIRECTIONS = {"right": (1, 0), "down": (0, 1), "left": (-1, 0), "up": (0, -1)}
WITHOUT_GREEN_CONES = np.array([[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]])
"""Deuteranopia on linear RGB (Machado et al. 2009, table 1)."""


def lab(colour):
    rgb = np.asarray(colour, np.float32).reshape(1, 1, 3) / 255
    return cv2.cvtColor(rgb, cv2.COLOR_RGB2LAB)[0, 0]


def seen_without_green_cones(colour):
    linear = (np.asarray(colour) / 255) ** 2.2
    return np.clip(WITHOUT_GREEN_CONES @ linear, 0, 1) ** (1 / 2.2) * 255


def pure(direction):
    return direction_colours(np.array(DIRECTIONS[direction], float), full=1.0)


@pytest.mark.parametrize(("one", "other"), [("right", "left"), ("up", "down"), ("right", "down"), ("left", "up")])
def test_directions_differ_for_every_eye(one, other):
    assert np.linalg.norm(lab(pure(one)) - lab(pure(other))) > 40
    assert np.linalg.norm(lab(seen_without_green_cones(pure(one))) - lab(seen_without_green_cones(pure(other)))) > 20


def test_polarities_differ_for_every_eye():
    assert np.linalg.norm(lab(seen_without_green_cones(POSITIVE)) - lab(seen_without_green_cones(NEGATIVE))) > 40


def test_directions_have_no_seam():
    turn = np.linspace(0, 2 * np.pi, 721)
    colours = direction_colours(np.stack([np.cos(turn), np.sin(turn)], axis=-1), full=1.0).astype(int)
    assert np.abs(np.diff(colours, axis=0)).max() <= 8


def test_rest_is_grey_and_speed_above_full_changes_nothing():
    rest, full, faster = direction_colours(np.array([[0, 0], [1, 0], [9, 0]], float), full=1.0).astype(int)
    assert np.ptp(rest) < 12
    assert full.tolist() == faster.tolist()


def test_ids_keep_their_colour_and_neighbours_differ():
    assert [id_colour(one) for one in range(1, 9)] == list(OBJECTS)
    assert len(set(OBJECTS)) == 8
    assert id_colour(9) == id_colour(1)
    assert id_table()[[0, 3]].tolist() == [[0, 0, 0], list(id_colour(3))]


def test_near_is_bright_and_far_is_dark():
    lightness = [float(lab(colour)[0]) for colour in depth_table()]
    assert np.all(np.diff(lightness) <= 0.2)
    assert lightness[0] > 85 and lightness[-1] < 20


def test_depth_one_is_in_the_middle_and_the_ends_clip():
    index = depth_index(np.array([[0.01, 0.25, 0.5, 1.0, 2.0, 4.0, 50.0]], np.float32))[0]
    assert index.tolist() == approx([0, 0, 64, 127, 191, 255, 255], abs=1)


def test_painted_is_a_table_look_up():
    indices = np.arange(256, dtype=np.uint8).reshape(8, 32)
    assert np.array_equal(painted(indices, id_table()), id_table()[indices])
