import numpy as np
import pytest
import torch

from evimo.events.direct_alignment import FEWEST, aligned
from evimo.events.stack import EventStack, StaticMotion
from evimo.geometry.poses import se3_exp

LENS = np.array((240.0, 236.0, 159.5, 119.5), np.float32)
HEIGHT, WIDTH = 240, 320
TRUTH = np.array((0.002, -0.0015, 0.003, 0.001, -0.002, 0.0025))  # about 1 px per slice
ERROR = np.array((0.0008, -0.0008, 0.001, 0.0008, 0.0008, 0.001))
STILL = np.zeros(6)


def seen(points, t, twist):
    """Where a camera that moves by exp(t twist) sees points (N, 3) of the static world at times (N,)."""
    poses = torch.linalg.inv(se3_exp(torch.from_numpy(t[:, None] * twist)))
    at = (poses[:, :3, :3] @ torch.from_numpy(points)[..., None])[..., 0] + poses[:, :3, 3]
    fx, fy, cx, cy = LENS.astype(float)
    x, y, z = at.numpy().T
    return fx * x / z + cx, fy * y / z + cy


def world(twist, *, dots=6000, each=8, noise=0, seed=0):
    """Dots on two walls, each with events of one polarity at random times; and noise. (stack, inverse depth)."""
    rng = np.random.default_rng(seed)
    fx, fy, cx, cy = LENS.astype(float)
    x, y = rng.uniform(-15, WIDTH + 15, dots), rng.uniform(-15, HEIGHT + 15, dots)
    depth = np.where(x < WIDTH / 2, 0.8, 1.3)
    points = np.stack(((x - cx) / fx * depth, (y - cy) / fy * depth, depth), axis=1)
    which, t = rng.integers(dots, size=dots * each), rng.uniform(-2.5, 2.5, dots * each)
    x, y = seen(points[which], t, twist)
    x, y = np.append(x, rng.uniform(0, WIDTH, noise)), np.append(y, rng.uniform(0, HEIGHT, noise))
    t, positive = np.append(t, rng.uniform(-2.5, 2.5, noise)), np.append(which % 2 > 0, rng.random(noise) > 0.5)
    inside = (x > 0) & (x < WIDTH - 1) & (y > 0) & (y < HEIGHT - 1)
    columns = (each[inside].astype(np.float32) for each in (x, y, t))
    inv_depth = np.tile(1 / np.where(np.arange(0, WIDTH, 4) < WIDTH / 2, 0.8, 1.3), (HEIGHT // 4, 1))
    return EventStack(*columns, positive[inside]), inv_depth.astype(np.float32)


def with_mover(stack, *, count=8000):
    """A dense square of 30 px in front of the world that goes 4 px to the right per slice."""
    rng = np.random.default_rng(1)
    t, dot = rng.uniform(-2.5, 2.5, count), rng.integers(100, size=count)
    x, y = rng.uniform(60, 90, 100)[dot] + 4 * t, rng.uniform(40, 70, 100)[dot]
    columns = zip(stack, (x, y, t, dot % 2 > 0), strict=True)
    return EventStack(*(np.concatenate((old, new.astype(old.dtype))) for old, new in columns))


def left_px(motion):
    """Mean error over a grid of points of the static world, px per slice."""
    columns, rows = np.meshgrid(np.arange(4.0, WIDTH, 8), np.arange(4.0, HEIGHT, 8))
    fx, fy, cx, cy = LENS.astype(float)
    depth = np.where(columns < WIDTH / 2, 0.8, 1.3)
    points = np.stack(((columns - cx) / fx * depth, (rows - cy) / fy * depth, depth), -1).reshape(-1, 3)
    now = np.ones(len(points))
    true, found = seen(points, now, TRUTH), seen(points, now, motion.twist[2].astype(float))
    return np.hypot(true[0] - found[0], true[1] - found[1]).mean()


def guess(inv_depth, twist):
    return StaticMotion(np.tile(twist, (5, 1)).astype(np.float32), inv_depth, 4, LENS)


@pytest.mark.parametrize("start", [TRUTH + ERROR, 0.5 * TRUTH, 1.5 * TRUTH])
def test_a_wrong_twist_is_corrected(start):
    stack, inv_depth = world(TRUTH)
    first = guess(inv_depth, start)
    once = aligned(stack, first)
    assert left_px(first) > 0.35
    assert left_px(once) < 0.35 * left_px(first)
    assert left_px(aligned(stack, once)) < 0.1


@pytest.mark.parametrize("axis", range(6))
def test_each_component_is_corrected_in_its_own_direction(axis):
    """The camera's poses say which way: translation right, down, forward, then rotation about the same axes."""
    stack, inv_depth = world(TRUTH)
    error = np.zeros(6)
    error[axis] = (2.0 if axis % 3 == 2 else 0.5) / LENS[0]  # half a pixel per slice; further out what is seen of z
    once = aligned(stack, guess(inv_depth, TRUTH + error))
    twice = aligned(stack, once)
    assert abs(twice.twist[2, axis] - TRUTH[axis]) < 0.45 * error[axis]
    assert left_px(twice) < 0.4 * left_px(guess(inv_depth, TRUTH + error))


def test_noise_takes_away_a_part_of_the_correction_only():
    stack, inv_depth = world(TRUTH, noise=12_000)
    first = guess(inv_depth, 0.5 * TRUTH)
    assert left_px(aligned(stack, first)) < 0.45 * left_px(first)


def test_what_moves_by_itself_loses_its_say():
    stack, inv_depth = world(TRUTH)
    first = guess(inv_depth, TRUTH + ERROR)
    assert left_px(aligned(with_mover(stack), first)) < 0.3 * left_px(first)


@pytest.mark.parametrize("place", [(20.0, 20.0), (300.0, 120.0)])
def test_a_hot_pixel_where_nothing_else_is_turns_nothing(place):
    """It stands still on the sensor, hundreds of times a second, where each event is compared with its emptiness."""
    stack, inv_depth = world(TRUTH)
    kept = np.hypot(stack.x - place[0], stack.y - place[1]) > 60
    t = np.linspace(-2.5, 2.5, 125, endpoint=False, dtype=np.float32)
    hot = (np.full_like(t, place[0]), np.full_like(t, place[1]), t, np.ones(len(t), np.bool_))
    alone = EventStack(*(column[kept] for column in stack))
    both = EventStack(*(np.concatenate(columns) for columns in zip(alone, hot, strict=True)))
    without, with_it = (aligned(each, guess(inv_depth, TRUTH + ERROR)) for each in (alone, both))
    assert left_px(with_it) < left_px(without) + 0.05


def test_a_right_twist_stays():
    stack, inv_depth = world(TRUTH)
    assert left_px(aligned(stack, guess(inv_depth, TRUTH))) < 0.06


def test_a_mover_does_not_lead_a_camera_at_rest_away():
    """Nothing but a mover has events: the same correction that a moving camera would get is not believed."""
    nothing, inv_depth = world(STILL, dots=1, noise=300)
    stack = with_mover(nothing, count=3000)
    assert left_px(guess(inv_depth, STILL)) > 0.5  # of the camera of the other tests
    assert np.abs(aligned(stack, guess(inv_depth, STILL)).twist).max() * LENS[0] < 0.25


def test_noise_alone_moves_nothing():
    stack, inv_depth = world(TRUTH, dots=1, noise=40_000)
    assert np.abs(aligned(stack, guess(inv_depth, STILL)).twist).max() * LENS[0] < 0.1


def test_all_slices_are_corrected_alike():
    stack, inv_depth = world(TRUTH)
    twists = (TRUTH + ERROR + np.linspace(-1e-3, 1e-3, 5)[:, None]).astype(np.float32)
    first = guess(inv_depth, STILL)._replace(twist=twists)
    change = aligned(stack, first).twist - twists
    np.testing.assert_allclose(change, np.tile(change[2], (5, 1)), atol=1e-7)
    assert np.abs(change[2]).max() > 5e-4


def test_a_known_rotation_stays():
    stack, inv_depth = world(TRUTH)
    start = TRUTH + ERROR * (1, 1, 1, 0, 0, 0)
    found = aligned(stack, guess(inv_depth, start), known_rotation=True)
    np.testing.assert_allclose(found.twist[:, 3:], np.tile(start[3:], (5, 1)), atol=1e-5)
    assert left_px(found) < 0.3 * left_px(guess(inv_depth, start))


def test_too_few_events_say_nothing():
    stack, inv_depth = world(TRUTH)
    few = EventStack(*(column[: FEWEST - 1] for column in stack))
    np.testing.assert_array_equal(aligned(few, guess(inv_depth, STILL)).twist, 0)


def test_events_beyond_the_image_say_nothing():
    outside = EventStack(
        *(np.full(2 * FEWEST, value, np.float32) for value in (-50, 1000, 0)), np.ones(2 * FEWEST, np.bool_)
    )
    np.testing.assert_array_equal(
        aligned(outside, guess(np.ones((30, 40), np.float32), TRUTH)).twist[0], np.float32(TRUTH)
    )


def test_where_nothing_is_nothing_is_corrected():
    """All events in one place, none elsewhere: no division by nothing."""
    events = EventStack(
        *(np.full(2 * FEWEST, value, np.float32) for value in (70, 50, 0)), np.ones(2 * FEWEST, np.bool_)
    )
    found = aligned(events, guess(np.ones((30, 40), np.float32), STILL))
    assert np.isfinite(found.twist).all() and np.abs(found.twist).max() * LENS[0] < 0.1
