import numpy as np
import pytest
import torch

from evimo.events.stack import (
    FIT_FEATURES,
    EventStack,
    StaticMotion,
    compensated,
    plane_fits,
    voxel_grid,
)
from evimo.geometry.motion_field import motion_field
from evimo.geometry.poses import se3_exp

INTRINSICS = np.array((60.0, 55.0, 33.0, 22.5), np.float32)
SIZE = (48, 64)
TWISTS = np.array(  # mean depths and rad per slice, another one in each slice
    [
        (0.02, -0.01, 0.03, 0.01, -0.02, 0.02),
        (0.01, 0.02, -0.02, -0.01, 0.01, 0.01),
        (-0.02, 0.01, 0.02, 0.02, 0.01, -0.02),
        (0.03, -0.02, 0.01, 0.01, 0.02, 0.01),
        (-0.01, 0.03, -0.03, -0.02, 0.01, -0.01),
    ]
)


def stack_of(x, y, t, positive=True):
    x, y, t = np.broadcast_arrays(*(np.atleast_1d(np.asarray(each, np.float32)) for each in (x, y, t)))
    return EventStack(x.copy(), y.copy(), t.copy(), np.broadcast_to(positive, x.shape).copy())


def camera_at(t, twists):
    """world_from_cam (4, 4) at a time in slices, where the camera is the world at the centre of the middle slice."""
    pose = torch.eye(4, dtype=torch.float64)
    way = 1 if t > 0 else -1
    number, left = 2, abs(t)
    for length in (0.5, 1, 1):
        part = min(left, length)
        pose = pose @ se3_exp(torch.from_numpy(twists[number]) * way * part)
        number, left = number + way, left - part
        if left <= 0:
            break
    return pose.numpy()


def seen_of_static_points(x, y, depth, t, twists):
    """Where points that are at pixels (x, y) at the centre are seen at times t."""
    fx, fy, cx, cy = INTRINSICS.astype(float)
    points = np.stack(((x - cx) / fx * depth, (y - cy) / fy * depth, depth, np.ones_like(x)), axis=1)
    at = np.stack([np.linalg.inv(camera_at(when, twists)) @ point for when, point in zip(t, points, strict=True)])
    return fx * at[:, 0] / at[:, 2] + cx, fy * at[:, 1] / at[:, 2] + cy


@pytest.fixture
def cloud():
    """Places at the centre, depths and times of 400 events of a world of two walls."""
    rng = np.random.default_rng(0)
    x, y, t = rng.uniform(8, 55, 400), rng.uniform(8, 39, 400), rng.uniform(-2.5, 2.5, 400)
    x = x[keep := abs(x - 31.5) > 6]  # away from the edge between the walls
    return x, y[keep], np.where(x < 31.5, 0.7, 1.4), t[keep]


def motion_of(twists, *, step=1):
    depth = np.where(np.arange(0, SIZE[1], step) < 31.5, 0.7, 1.4)
    inv_depth = np.tile(1 / depth, (SIZE[0] // step, 1))
    return StaticMotion(twists.astype(np.float32), inv_depth.astype(np.float32), step, INTRINSICS)


def error_of(cloud, twists, *, step=1):
    x, y, depth, t = cloud
    seen = seen_of_static_points(x, y, depth, t, twists)
    back = compensated(stack_of(*seen, t), motion_of(twists, step=step))
    moved = np.hypot(seen[0] - x, seen[1] - y)
    return np.hypot(back.x - x, back.y - y), moved


@pytest.mark.parametrize("step", [1, 4])
def test_events_of_a_static_world_return_to_where_they_are_at_the_centre(cloud, step):
    error, moved = error_of(cloud, TWISTS, step=step)
    assert moved.max() > 5
    assert error.max() < 0.3
    assert error.mean() < 0.03 * moved.mean()


def test_half_the_motion_leaves_a_quarter_of_the_error(cloud):
    whole, half = (error_of(cloud, TWISTS * share)[0].mean() for share in (1, 0.5))
    assert half < whole / 3.5


def test_half_a_turn_about_the_optical_axis_leaves_an_eighth_of_the_error(cloud):
    """The motion field is taken in the middle of the way, not at its start: of second order where nothing else is."""
    roll = np.tile((0, 0, 0, 0, 0, 0.08), (5, 1))
    whole, half = (error_of(cloud, roll * share)[0].mean() for share in (1, 0.5))
    assert half < whole / 6


@pytest.mark.parametrize("number", range(5))
def test_each_slice_has_its_own_twist(number):
    """Only events from that slice on, away from the middle, know of a turn in it."""
    twists = np.zeros((5, 6))
    twists[number, 5] = 0.1
    t = np.arange(-2.4, 2.5, 0.2)
    back = compensated(stack_of(50, 22.5, t), motion_of(twists))
    moved = back.y - 22.5
    if number == 2:
        assert (np.abs(moved[np.abs(t) > 0.15]) > 0.1).all()
    else:
        away = t < number - 2 + 0.5 if number < 2 else t > number - 2 - 0.5
        np.testing.assert_array_equal(np.abs(moved) > 1e-4, away)


@pytest.mark.parametrize("axis", range(6))
def test_compiled_twin_is_the_motion_field_for_a_small_motion(axis):
    twists = np.tile(1e-3 * np.eye(6)[axis], (5, 1))
    y, x = (each.ravel().astype(np.float32) for each in np.mgrid[2:46:5, 2:62:5])
    inv_depth = np.random.default_rng(1).uniform(0.5, 2, SIZE).astype(np.float32)
    back = compensated(stack_of(x, y, 1.0), StaticMotion(twists.astype(np.float32), inv_depth, 1, INTRINSICS))
    fx, fy, cx, cy = INTRINSICS.tolist()
    grid = torch.from_numpy(np.stack(((x - cx) / fx, (y - cy) / fy))).double()[:, None]
    at = torch.from_numpy(inv_depth[y.astype(int), x.astype(int)]).double()[None, None]
    flow = motion_field(torch.from_numpy(twists[0]).view(6, 1, 1), at, grid)[:, 0]
    np.testing.assert_allclose(x - back.x, fx * flow[0], atol=3e-4, rtol=0)
    np.testing.assert_allclose(y - back.y, fy * flow[1], atol=3e-4, rtol=0)
    assert fx * flow.abs().max() > 0.02


def test_what_happens_at_the_centre_stays_where_it_is(cloud):
    x, y, _, _ = cloud
    back = compensated(stack_of(x, y, 0), motion_of(TWISTS * 5))
    np.testing.assert_array_equal(back.x, x.astype(np.float32))
    np.testing.assert_array_equal(back.y, y.astype(np.float32))


def test_no_event_is_no_event():
    none = stack_of(np.zeros(0), np.zeros(0), np.zeros(0))
    assert len(compensated(none, motion_of(TWISTS)).x) == 0
    assert not voxel_grid(none, (3, 4)).any()
    assert not plane_fits(none, (3, 4)).any()


def counts_of(stack, **how):
    return np.expm1(voxel_grid(stack, (3, 4), **how))


def test_an_event_on_a_pixel_counts_there_alone():
    counts = counts_of(stack_of([1, 1, 3], [2, 2, 0], -2.5))
    expected = np.zeros((30, 3, 4))
    expected[0, 2, 1], expected[0, 0, 3] = 2, 1
    np.testing.assert_allclose(counts, expected, atol=1e-6)


@pytest.mark.parametrize(
    ("t", "channel"), [(-2.5, 0), (-2.17, 0), (-2.16, 2), (-1.5, 6), (-0.5, 12), (0, 14), (0.2, 16), (2.49, 28)]
)
@pytest.mark.parametrize("positive", [True, False])
def test_channels_are_slices_then_bins_then_polarities(t, channel, positive):
    counts = counts_of(stack_of(1, 1, t, positive))
    assert np.flatnonzero(counts.any((1, 2))).tolist() == [channel if positive else channel + 1]


def test_an_event_between_pixels_is_shared_by_area():
    counts = counts_of(stack_of(1.25, 0.5, 0))[14]
    expected = np.zeros((3, 4))
    expected[:2, 1], expected[:2, 2] = 0.375, 0.125
    np.testing.assert_allclose(counts, expected, atol=1e-6)


@pytest.mark.parametrize(("x", "column"), [(0.5, 0), (2.5, 1), (1.5, 0.5), (6.5, 3), (2, 0.75)])
def test_convention_half_the_size_has_its_centres_between_two_pixels(x, column):
    counts = counts_of(stack_of(x, 2.5, 0), step=2)[14]
    assert counts.sum() == pytest.approx(1)
    assert counts[1] @ np.arange(4) == pytest.approx(column)


@pytest.mark.parametrize(
    ("x", "y", "count"),
    [(-0.5, 0, 1), (3.49, 0, 1), (-0.51, 0, 0), (3.51, 0, 0), (0, -0.5, 1), (0, 2.49, 1), (0, -0.51, 0), (0, 2.51, 0)],
)
def test_convention_the_image_ends_half_a_pixel_beyond_its_last_centre(x, y, count):
    assert counts_of(stack_of(x, y, 0)).sum() == pytest.approx(count, abs=1e-6)


def test_all_events_inside_are_counted():
    rng = np.random.default_rng(0)
    x, y, t = rng.uniform(-0.5, 9.49, 500), rng.uniform(-0.5, 7.49, 500), rng.uniform(-2.5, 2.5, 500)
    on = rng.random(500) < 0.4
    for step in (1, 2):
        counts = np.expm1(voxel_grid(stack_of(x, y, t, on), (8 // step, 10 // step), step=step))
        assert counts[::2].sum() == pytest.approx(on.sum(), rel=1e-5)
        assert counts[1::2].sum() == pytest.approx((~on).sum(), rel=1e-5)
        by_slice = np.histogram(t, np.arange(-2.5, 3))[0]
        np.testing.assert_allclose(counts.reshape(5, -1).sum(1), by_slice, rtol=1e-5)


def test_memory_is_used_again():
    out = np.full((30, 3, 4), 7, np.float32)
    stack = stack_of([1, 2], [0, 1.5], [0.1, 0.2])
    assert voxel_grid(stack, (3, 4), out=out) is out
    np.testing.assert_array_equal(out, voxel_grid(stack, (3, 4)))


def features(stack, size, row, column):
    """By window (middle slice, whole stack) and polarity (positive, negative): (2, 2, 6)."""
    return plane_fits(stack, size)[:, row, column].reshape(2, 2, FIT_FEATURES)


def moving_edge(normal, speed, *, middle=20.0, length=40):
    """Events of a straight edge that moves along its normal, px per slice, and is in the middle at the centre."""
    t, along = (each.ravel() for each in np.meshgrid(np.linspace(-2.5, 2.5, 200, endpoint=False), np.arange(length)))
    along = along - length / 2
    normal = np.array(normal)
    x, y = normal[:, None] * speed * t + np.array((-normal[1], normal[0]))[:, None] * along + middle
    return stack_of(x, y, t)


@pytest.mark.parametrize("normal", [(1.0, 0.0), (0.0, 1.0), (0.6, 0.8), (-0.8, 0.6)])
@pytest.mark.parametrize("speed", [1.5, -2.5])
def test_a_moving_edge_has_its_normal_velocity(normal, speed):
    found = features(moving_edge(normal, speed), (20, 20), 10, 10)[1, 0]
    bounded = found[:2] / (1 - np.abs(found[:2]) / 3)  # undoes u / (1 + |u| / 3)
    np.testing.assert_allclose(bounded, np.array(normal) * speed, rtol=0.08, atol=0.02)
    assert 0.85 < found[4] < 1.001
    np.testing.assert_array_equal(np.sign(found[2:4].round(3)), np.sign(np.array(normal) * speed))


def test_only_the_middle_slice_counts_in_its_window():
    steady, other = moving_edge((1, 0), 6.0), moving_edge((1, 0), -6.0)
    now = np.abs(steady.t) <= 0.5
    mixed = EventStack(*(np.where(now, a, b) for a, b in zip(steady, other, strict=True)))
    np.testing.assert_array_equal(features(mixed, (20, 20), 10, 10)[0], features(steady, (20, 20), 10, 10)[0])
    assert features(mixed, (20, 20), 10, 10)[1, 0, 0] < 0 < features(mixed, (20, 20), 10, 10)[0, 0, 0]


def test_a_pixel_that_flickers_has_no_slope():
    flicker = stack_of(9, 7, np.linspace(-2.4, 2.4, 50), False)
    found = features(flicker, (8, 8), 3, 4)
    np.testing.assert_allclose(found[:, 1, :5], 0, atol=1e-4)
    assert found[1, 1, 5] == pytest.approx(0.3 * np.log(50))
    assert not found[:, 0].any()


def test_a_plane_wants_four_events():
    places = [3, 4, 5, 6], [3, 4, 3, 5], [-0.3, -0.1, 0.1, 0.3]
    assert features(stack_of(*places), (8, 8), 2, 2)[0, 0].all()
    assert not features(stack_of(*(each[:3] for each in places)), (8, 8), 2, 2).any()


def test_a_window_reaches_three_cells_to_each_side():
    cluster = stack_of([20, 21, 20, 21], [20, 20, 21, 21], [-0.2, 0.1, 0, 0.2])  # all in cell (10, 10)
    counted = plane_fits(cluster, (20, 20))[5] > 0
    expected = np.zeros((20, 20), bool)
    expected[7:14, 7:14] = True
    np.testing.assert_array_equal(counted, expected)


def test_far_from_the_middle_a_plane_is_as_exact_as_least_squares_in_float64():
    rng = np.random.default_rng(2)
    x, y = rng.uniform(290, 304, 20_000), rng.uniform(4, 18, 20_000)
    t = 0.03 * (x - 297) - 0.04 * (y - 11) + 0.05 * rng.normal(size=20_000)
    stack = stack_of(x, y, t)
    found = features(stack, (100, 160), 5, 148)[1, 0]
    cells = (np.floor((stack.x + 0.5) / 2), np.floor((stack.y + 0.5) / 2))
    inside = (np.abs(cells[0] - 148) <= 3) & (np.abs(cells[1] - 5) <= 3)
    at = np.stack((stack.x, stack.y), axis=1).astype(float)[inside]
    t = stack.t.astype(float)[inside]
    centred, since = at - at.mean(0), t - t.mean()
    kept = np.sqrt(0.5 * len(t)) * np.eye(2)  # half a pixel squared of doubt about each place
    slope = np.linalg.lstsq(np.concatenate((centred, kept)), np.append(since, (0, 0)), rcond=None)[0]
    np.testing.assert_allclose(found[2:4], 3 * slope / (np.sqrt(since.var() + 1e-4) + 0.05), atol=1e-4, rtol=0)
    assert found[4] == pytest.approx(slope @ (centred.T @ since) / len(t) / (since.var() + 1e-4), abs=1e-3)
