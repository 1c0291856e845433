"""What the passes see of events whose places are known."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from evimo.events.events import Events
from evimo.events.slices import Slice
from evimo.events.stack import EventStack, voxel_grid
from evimo.geometry.camera import Camera
from evimo.geometry.rectification import rectified
from evimo.streaming.inference import CameraMotion
from evimo.streaming.looks import Looks, Placed, halved_mask, stacked

CAMERA = Camera(40.0, 50.0, 20.0, 15.0, 30, 42)  # no multiple of the stride
LENS = Camera(20.0, 20.0, 20.5, 14.5, 30, 42, distortion=(-0.5, 0.1, 0.0, 0.0))
STRIDE = 8
PADDED = 32, 48
UNKNOWN = np.zeros(4, np.float32)


@pytest.fixture(scope="module")
def looks():
    return Looks(rectified(CAMERA), stride=STRIDE)


def stack_of(x, y, t, positive=True) -> EventStack:
    x, y, t = (np.array(each, np.float32) for each in np.broadcast_arrays(x, y, t))
    return EventStack(x, y, t, np.broadcast_to(positive, x.shape).copy())


def some_events(count: int = 400, *, seed: int = 0) -> EventStack:
    rng = np.random.default_rng(seed)
    x, y = rng.integers(0, 42, count), rng.integers(0, 30, count)
    return stack_of(x, y, rng.uniform(-2.5, 2.5, count), rng.random(count) < 0.5)


def motion_of(ego=(0, 0, 0, 0, 0, 0), *, rel_depth=1.0) -> CameraMotion:
    quarter = PADDED[0] // 4, PADDED[1] // 4
    nothing = np.zeros((2, *quarter), np.float32)
    return CameraMotion(np.full(quarter, rel_depth, np.float32), np.array(ego, np.float32), nothing, nothing)


def slice_of(x, y, t_us, p) -> Slice:
    whole = Events(np.array(x, np.uint16), np.array(y, np.uint16), np.array(t_us), np.array(p, np.int8))
    return Slice(40, 1_000_000, 1_025_000, whole)


def test_without_a_lens_events_stay_where_they_are():
    placed = Placed(rectified(CAMERA))
    part = placed.slice(slice_of([3, 41, 0], [7, 29, 0], [1_000_000, 1_012_500, 1_022_500], [1, -1, 1]))
    np.testing.assert_array_equal(part.x, [3, 41, 0])
    np.testing.assert_array_equal(part.y, [7, 29, 0])
    np.testing.assert_allclose(part.t, [-0.5, 0, 0.4], rtol=1e-6)
    assert part.positive.tolist() == [True, False, True]
    assert placed.dropped == 0


def test_events_without_a_place_are_dropped_and_counted():
    rectification = rectified(LENS)
    assert not rectification.valid[0, 0] and rectification.valid[14, 30]
    placed = Placed(rectification)
    for count in (1, 2):
        part = placed.slice(slice_of([0, 30, 42, 5], [0, 14, 3, 30], np.full(4, 1_000_000), np.ones(4)))
        assert (part.x.tolist(), part.y.tolist()) == ([rectification.x[14, 30]], [rectification.y[14, 30]])
        assert placed.dropped == 3 * count  # without a place, and two beyond the sensor


def test_a_stack_counts_time_from_its_middle_slice():
    early, now, late = stack_of([1], [2], [-0.5]), stack_of([3, 4], [5, 6], [0, 0.25]), stack_of([7], [8], [0.4], False)
    whole = stacked([early, None, now, None, late])
    np.testing.assert_allclose(whole.t, [-2.5, 0, 0.25, 2.4])
    assert (whole.x.tolist(), whole.y.tolist()) == ([1, 3, 4, 7], [2, 5, 6, 8])
    assert whole.positive.tolist() == [True, True, True, False]
    assert all(column.dtype == np.float32 for column in whole[:3])


def test_a_stack_of_nothing_is_empty():
    assert [len(column) for column in stacked([None] * 5)] == [0, 0, 0, 0]


def test_a_halved_mask_is_the_share_of_four_pixels():
    mask = np.array([[1, 1, 0], [1, 1, 1], [0, 1, 1]], np.bool_)
    np.testing.assert_array_equal(halved_mask(mask, (4, 6)), [[1, 0.25, 0], [0.25, 0.25, 0]])


def test_the_first_look_is_at_half_size(looks):
    rotation = np.array((0.1, 0.2, 0.3, 1), np.float32)
    seen = looks.first(stack_of([10.5, 10.5], [6.5, 6.5], [0, 2.4], [True, False]), rotation)
    assert [each.shape for each in seen] == [(30, 16, 24), (24, 16, 24), (16, 24), (4,), (4,)]
    assert np.argwhere(seen.voxels).tolist() == [[14, 3, 5], [29, 3, 5]]  # middle slice positive, last bin negative
    assert seen.intrinsics.tolist() == [40, 50, 20, 15]
    assert seen.rotation is rotation
    assert seen.valid[:15, :21].all() and not seen.valid[15:].any() and not seen.valid[:, 21:].any()


def test_a_second_look_without_motion_is_at_the_events_as_they_are(looks):
    stack = some_events()
    seen = looks.second(stack, [motion_of()] * 5, UNKNOWN)
    assert [each.shape for each in seen] == [(30, *PADDED), (24, 16, 24), (16, 24), (4,), (4,)]
    np.testing.assert_allclose(seen.voxels, voxel_grid(stack, PADDED), atol=1e-5)
    np.testing.assert_allclose(seen.fits, looks.first(stack, UNKNOWN).fits, atol=1e-5)


@pytest.mark.parametrize("rel_depth", [1.0, 2.0])
def test_a_second_look_undoes_a_translation_at_its_depth(looks, rel_depth):
    """A camera that goes right at 0.05 mean depths per slice sees a point at that depth go 2 px left."""
    t = np.linspace(-2.4, 2.4, 49)
    seen = looks.second(
        stack_of(20 - 40 * 0.05 / rel_depth * t, 9, t),
        [motion_of((0.05, 0, 0, 0, 0, 0), rel_depth=rel_depth)] * 5,
        UNKNOWN,
    )
    counts = np.expm1(seen.voxels).sum(0)
    assert counts[9, 20] == pytest.approx(49, abs=0.1)


def test_a_second_look_undoes_each_slices_own_rotation(looks):
    """About y, at other rates in each slice; from the middle of the middle one the angle is their sum."""
    rates = np.array((0.01, -0.03, 0.02, 0.04, -0.01))
    t = np.linspace(-2.49, 2.49, 200)
    moments = np.linspace(-2.5, 2.5, 5001)
    angles = np.concatenate(([0], np.cumsum(rates[np.minimum((moments[:-1] + 2.5).astype(int), 4)]) * 1e-3))
    angle = np.interp(t, moments, angles) - np.interp(0, moments, angles)
    stack = stack_of(20 - 40 * np.tan(angle), 15, t)  # a point straight ahead
    assert np.ptp(stack.x) > 1
    seen = looks.second(stack, [motion_of((0, 0, 0, 0, rate, 0)) for rate in rates], UNKNOWN)
    assert np.expm1(seen.voxels).sum(0)[15, 20] == pytest.approx(200, abs=1)


def test_threads_do_not_write_into_each_others_looks(looks):
    stacks = [some_events(seed=seed) for seed in range(8)]

    def alone(stack):
        return looks.first(stack, UNKNOWN).voxels.copy()

    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(alone, stacks * 10))
    for one, stack in zip(together, stacks * 10, strict=True):
        np.testing.assert_array_equal(one, voxel_grid(stack, (16, 24), step=2))
