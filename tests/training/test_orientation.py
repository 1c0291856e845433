from itertools import product

import numpy as np
import pytest
import torch

from evimo.events.stack import EventStack, StaticMotion, compensated
from evimo.geometry.grids import normalised_grid
from evimo.geometry.motion_field import motion_field
from evimo.training.orientation import AS_FILMED, Orientation, drawn_orientation

SIZE = (6, 9)
INTRINSICS = np.array((7, 6, 3.7, 2.9), np.float32)
MIRRORS = list(product((False, True), repeat=2))
ALL = [
    Orientation(mirrored=mirrored, swapped=swapped, reversed=reversed_)
    for mirrored in MIRRORS
    for swapped in (False, True)
    for reversed_ in (False, True)
]


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def flow_of(twist, velocity, inv_depth, intrinsics):
    """(2, H, W) by equation 1 for objects of a velocity (3, H, W)."""
    twists = torch.from_numpy(twist)[:, None, None].repeat(1, *SIZE)
    twists[:3] -= torch.from_numpy(velocity)
    image = torch.from_numpy(inv_depth)[None]
    return motion_field(twists, image, normalised_grid(torch.from_numpy(intrinsics), image)).numpy()


@pytest.mark.parametrize("way", ALL, ids=str)
def test_the_motion_field_still_holds(way, rng):
    twist, velocity = rng.normal(size=6).astype(np.float32), rng.normal(size=(3, *SIZE)).astype(np.float32)
    inv_depth = rng.uniform(0.5, 2, SIZE).astype(np.float32)
    flow = flow_of(twist, velocity, inv_depth, INTRINSICS)
    expected = flow_of(
        way.of_twist(twist), way.of_vectors(velocity), way.of_image(inv_depth), way.of_intrinsics(INTRINSICS, SIZE)
    )
    np.testing.assert_allclose(way.of_vectors(flow), expected, atol=1e-5)


@pytest.mark.parametrize("way", ALL, ids=str)
def test_compensated_events_are_those_of_the_other_motion(way, rng):
    """Compensating, then turning round, is turning round, then compensating: events, twist and lens fit together."""
    x, y, t = (rng.uniform(low, high, 50).astype(np.float32) for low, high in ((0, 8), (0, 5), (-2.5, 2.5)))
    stack = EventStack(x, y, t, rng.random(50) < 0.5)
    twists = rng.normal(size=(5, 6)).astype(np.float32) * 0.1
    inv_depth = np.full(SIZE, 0.8, np.float32)
    there = way.of_events(compensated(stack, StaticMotion(twists, inv_depth, 1, INTRINSICS)), SIZE)
    others = np.stack([way.of_twist(twist) for twist in (twists[::-1] if way.reversed else twists)])
    motion = StaticMotion(others, inv_depth, 1, way.of_intrinsics(INTRINSICS, SIZE))
    back = compensated(way.of_events(stack, SIZE), motion)
    np.testing.assert_allclose(there.x, back.x, atol=1e-4)
    np.testing.assert_allclose(there.y, back.y, atol=1e-4)
    assert np.abs(back.x - way.of_events(stack, SIZE).x).max() > 0.5


@pytest.mark.parametrize("way", ALL, ids=str)
def test_twice_is_as_before(way, rng):
    stack = EventStack(*rng.uniform(0, 5, (3, 20)).astype(np.float32), rng.random(20) < 0.5)
    for column, same in zip(stack, way.of_events(way.of_events(stack, SIZE), SIZE), strict=True):
        np.testing.assert_allclose(column, same, atol=1e-6)
    image, twist = rng.normal(size=(3, *SIZE)).astype(np.float32), rng.normal(size=6).astype(np.float32)
    np.testing.assert_array_equal(way.of_image(way.of_image(image)), image)
    np.testing.assert_array_equal(way.of_vectors(way.of_vectors(image)), image)
    np.testing.assert_array_equal(way.of_twist(way.of_twist(twist)), twist)
    np.testing.assert_allclose(way.of_intrinsics(way.of_intrinsics(INTRINSICS, SIZE), SIZE), INTRINSICS, rtol=1e-6)


def test_a_mirror_along_x_exchanges_left_and_right():
    way = Orientation(mirrored=(True, False))
    stack = EventStack(*np.array([[2], [1], [0.5]], np.float32), np.array([True]))
    assert [column.tolist() for column in way.of_events(stack, SIZE)] == [[6], [1], [0.5], [True]]
    image = np.arange(54.0).reshape(SIZE)
    assert way.of_image(image)[1, 6] == image[1, 2]
    assert way.of_intrinsics(INTRINSICS, SIZE).tolist() == pytest.approx([7, 6, 4.3, 2.9])


def test_backwards_what_became_brighter_becomes_darker():
    stack = EventStack(*np.array([[2, 3], [1, 1], [0.5, -2]], np.float32), np.array([True, False]))
    back = Orientation(reversed=True).of_events(stack, SIZE)
    assert (back.t.tolist(), back.positive.tolist()) == ([-0.5, 2], [False, True])
    negative = Orientation(swapped=True).of_events(stack, SIZE)
    assert (negative.t.tolist(), negative.positive.tolist()) == ([0.5, -2], [False, True])
    both = Orientation(swapped=True, reversed=True).of_events(stack, SIZE)
    assert both.positive.tolist() == [True, False]


def test_as_filmed_changes_nothing(rng):
    stack = EventStack(*rng.uniform(0, 5, (3, 20)).astype(np.float32), rng.random(20) < 0.5)
    for column, same in zip(stack, AS_FILMED.of_events(stack, SIZE), strict=True):
        np.testing.assert_array_equal(column, same)


def test_every_orientation_is_drawn(rng):
    assert {drawn_orientation(rng) for _ in range(1000)} == set(ALL)
