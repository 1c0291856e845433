from itertools import product

import numpy as np
import pytest
import torch

from evimo.events.stack import EventStack
from evimo.geometry.grids import normalised_grid
from evimo.geometry.motion_field import motion_field
from evimo.training.orientation import AS_FILMED, Orientation, drawn_orientation

SIZE = 6, 9
WAYS = [
    Orientation(mirrored=(x, y), swapped=swapped, reversed=backwards)
    for x, y, swapped, backwards in product((False, True), repeat=4)
]


def flow_of(twist, depth, velocity, intrinsics):
    """By equation 1, of points that move with `velocity`."""
    relative = np.broadcast_to(twist[:, None, None], (6, *SIZE)).copy()
    relative[:3] -= velocity
    grid = normalised_grid(torch.from_numpy(intrinsics), torch.from_numpy(depth))
    return motion_field(torch.from_numpy(relative), torch.from_numpy(1 / depth), grid).numpy()


@pytest.fixture
def world():
    """Twist, depth, velocity and intrinsics at random."""
    rng = np.random.default_rng(0)
    depth = (0.5 + rng.random((1, *SIZE))).astype(np.float32)
    velocity = rng.normal(size=(3, *SIZE)).astype(np.float32)
    return rng.normal(size=6).astype(np.float32), depth, velocity, np.array((7, 6, 3.7, 2.9), np.float32)


def turned(world, way):
    twist, depth, velocity, intrinsics = world
    return way.of_twist(twist), way.of_image(depth), way.of_vectors(velocity), way.of_intrinsics(intrinsics, SIZE)


@pytest.mark.parametrize("way", WAYS, ids=str)
def test_the_motion_field_still_holds(way, world):
    np.testing.assert_allclose(way.of_vectors(flow_of(*world)), flow_of(*turned(world, way)), atol=1e-4, rtol=1e-4)


@pytest.mark.parametrize("way", WAYS, ids=str)
def test_twice_is_as_before(way, world, trace):
    for back, before in zip(turned(turned(world, way), way), world, strict=True):
        np.testing.assert_allclose(back, before, rtol=1e-6)
    for back, before in zip(way.of_events(way.of_events(trace, SIZE), SIZE), trace, strict=True):
        np.testing.assert_allclose(back, before, atol=1e-6)


def test_as_filmed_is_as_filmed(world):
    for same, before in zip(turned(world, AS_FILMED), world, strict=True):
        np.testing.assert_array_equal(same, before)


@pytest.fixture
def trace():
    """Events of one dot that becomes brighter; it moves by (0.5, -0.25) px per slice and is at (3, 2) at time 0."""
    t = np.linspace(-2, 2, 9, dtype=np.float32)
    return EventStack(3 + t / 2, 2 - t / 4, t, np.ones(9, bool))


@pytest.mark.parametrize("way", WAYS, ids=str)
def test_events_move_with_the_image(way, trace):
    x, y, t, _ = way.of_events(trace, SIZE)
    marked, flow = np.zeros((1, *SIZE), np.float32), np.zeros((2, *SIZE), np.float32)
    marked[0, 2, 3] = 1
    flow[:] = np.array((0.5, -0.25))[:, None, None]
    ((_, row, column),) = np.argwhere(way.of_image(marked))
    u, v = way.of_vectors(flow)[:, row, column]
    np.testing.assert_allclose(x, column + u * t, atol=1e-6)
    np.testing.assert_allclose(y, row + v * t, atol=1e-6)


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("backwards", [False, True])
def test_backwards_and_in_a_negative_what_became_brighter_becomes_darker(swapped, backwards, trace):
    positive = Orientation(swapped=swapped, reversed=backwards).of_events(trace, SIZE).positive
    assert positive.all() if swapped == backwards else not positive.any()


def test_a_mirror_along_x_exchanges_left_and_right(world):
    mirror = Orientation(mirrored=(True, False))
    np.testing.assert_array_equal(mirror.of_image(world[1])[..., 0], world[1][..., -1])
    corner = EventStack(np.float32([0]), np.float32([1]), np.float32([0]), np.array([True]))
    x, y, *_ = mirror.of_events(corner, SIZE)
    assert (x.item(), y.item()) == (8, 1)


def test_every_orientation_is_drawn():
    rng = np.random.default_rng(0)
    drawn = [drawn_orientation(rng) for _ in range(600)]
    assert all(way in drawn for way in WAYS)
    shares = [np.mean(kind) for kind in zip(*((*w.mirrored, w.swapped, w.reversed) for w in drawn), strict=True)]
    np.testing.assert_allclose(shares, (0.5, 0.25, 0.5, 0.3), atol=0.06)
