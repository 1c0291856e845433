from dataclasses import replace

import numpy as np
import pytest
import torch

from evimo.events.stack import StaticMotion
from evimo.geometry.grids import normalised_grid, resized_intrinsics
from evimo.geometry.motion_field import motion_field
from evimo.training import data as module
from evimo.training.data import drawn_batch, samples_of, stack_of, true_motion, whole_batch


def drawn(samples, seed, **how):
    return drawn_batch(samples, 4, np.random.default_rng(seed), **how)


def flow_that_follows(batch):
    """Flow from the batch's own depth, egomotion and object velocities."""
    twist = batch.ego[:, :, None, None].repeat(1, 1, *batch.depth.shape[-2:])
    twist[:, :3] -= batch.velocity
    grid = normalised_grid(resized_intrinsics(batch.intrinsics, (2, 2), (1, 1)), batch.depth)
    return motion_field(twist, 1 / batch.depth, grid)


def whole(recording, middle, stride=32):
    return whole_batch(recording, [middle], [true_motion(recording, middle)], stride)


@pytest.fixture
def turning(recording):
    """A larger known world before a camera that also turns, its flow as follows from that."""
    world = recording(size=(200, 260), slices=5)
    ego = np.tile(np.array((-0.4, 0.3, 0.5, 0.2, -0.3, 0.6), np.float32), (5, 1))
    twist = torch.from_numpy(ego).view(5, 6, 1, 1).repeat(1, 1, 200, 260)
    twist[:, :3] -= torch.from_numpy(np.moveaxis(world.velocity[np.arange(5)[:, None, None], world.ids], -1, 1))
    depth = torch.from_numpy(world.depth.astype(np.float32))[:, None]
    flow = motion_field(twist, 1 / depth, normalised_grid(torch.from_numpy(world.intrinsics), depth))
    return replace(world, ego=ego, flow=flow.numpy().astype(np.float16))


def test_every_slice_is_the_middle_of_one_sample(recording):
    samples = samples_of([recording(slices=3), recording(slices=2)])
    assert samples.index.tolist() == [[0, 0], [0, 1], [0, 2], [1, 0], [1, 1]]
    assert len(samples) == 5


def without_events(world):
    none = {name: getattr(world, name)[:0] for name in ("event_xy", "event_t", "event_on")}
    return replace(world, **none, event_first=np.zeros(len(world) + 1, np.int64))


def test_a_recording_without_events_has_no_samples(recording):
    samples = samples_of([recording(slices=2), without_events(recording(slices=3)), recording(slices=1)])
    assert samples.index.tolist() == [[0, 0], [0, 1], [2, 0]]
    assert len(samples_of([without_events(recording())])) == 0


def test_a_slice_without_events_is_a_sample_all_the_same(recording, small_crops):
    world = recording(slices=6)
    first, last = world.event_first[2], world.event_first[3]
    gone = {
        name: np.delete(getattr(world, name), slice(first, last), axis=0)
        for name in ("event_xy", "event_t", "event_on")
    }
    counts = np.diff(world.event_first)
    counts[2] = 0
    quiet = replace(world, **gone, event_first=np.cumsum([0, *counts]))
    batch = whole(quiet, 2)
    assert not batch.voxels[:, 12:18].any() and batch.voxels[:, :12].any()
    assert torch.isfinite(drawn(samples_of([quiet]), 0).sharp_fits).all()


def test_a_stack_is_the_events_of_five_slices(recording):
    world = recording()
    stack = stack_of(world, 3)
    assert np.unique(stack.t).tolist() == [-2, -1, 0, 1, 2]
    assert (stack.t == 1).sum() == world.event_first[5] - world.event_first[4]
    middle = slice(*world.event_first[3:5])
    np.testing.assert_array_equal(stack.x[stack.t == 0], world.event_xy[middle, 0] / 64)
    np.testing.assert_array_equal(stack.y[stack.t == 0], world.event_xy[middle, 1] / 64)
    np.testing.assert_array_equal(stack.positive[stack.t == 0], world.event_on[middle])


@pytest.mark.parametrize(("middle", "reach", "there"), [(0, 2, [0, 1, 2]), (6, 2, [-2, -1, 0]), (3, 0, [0])])
def test_slices_that_are_not_there_are_missing(middle, reach, there, recording):
    assert np.unique(stack_of(recording(), middle, reach=reach).t).tolist() == there


def test_time_within_a_slice_is_kept(recording):
    world = recording()
    early = replace(world, event_t=np.zeros_like(world.event_t))
    assert np.unique(stack_of(early, 3).t).tolist() == [-2.5, -1.5, -0.5, 0.5, 1.5]


def test_the_true_motion_is_in_mean_depths_per_slice(recording):
    world = recording(size=(32, 64))
    motion = true_motion(world, 3)
    mean = 1 / (motion.inv_depth * world.depth[3][2::4, 2::4].astype(np.float32)).mean() ** -1
    np.testing.assert_allclose(motion.twist[:, 0] * mean * 40, world.ego[1:6, 0], rtol=1e-3)
    # The wall moves 1 px per slice: -v / (Z / mean) times the focal length.
    wall = motion.inv_depth[0, 0]
    np.testing.assert_allclose(-motion.twist[:, 0] * wall * world.intrinsics[0], 1, rtol=1e-3)


def test_where_depth_is_unknown_it_is_the_mean(recording):
    world = recording()
    depth = world.depth.copy()
    depth[:, :8] = 0
    motion = true_motion(replace(world, depth=depth), 3)
    assert (motion.inv_depth[:2] == 1).all()
    assert (true_motion(replace(world, depth=depth * 0), 3).inv_depth == 1).all()


def test_a_whole_batch_is_stored_truth_padded_to_the_stride(recording):
    world = recording(size=(36, 60))
    batch = whole(world, 3)
    assert batch.sharp_voxels.shape == (1, 30, 64, 64) and batch.voxels.shape == (1, 30, 32, 32)
    assert batch.valid[..., :18, :30].all() and batch.valid.sum() == 18 * 30
    assert torch.equal(batch.moving[0, 0, :18, :30], torch.from_numpy(world.moving[3][1::2, 1::2]))
    assert torch.equal(batch.ego[0], torch.tensor(world.ego[3]))
    assert not batch.depth_valid[..., 18:, :].any()
    # The box moves, the wall does not; what each pixel shows flows as the motion field of its velocity says.
    known = batch.depth_valid.expand(1, 2, -1, -1)
    torch.testing.assert_close(batch.flow[known], flow_that_follows(batch)[known], atol=2e-3, rtol=1e-3)


def test_what_stands_still_is_sharp_and_what_moves_is_not(recording):
    """The wall's dots of all five slices fall on the same pixels; the box's go 2 px further with each slice."""
    world = recording()
    counts = whole(world, 3).sharp_voxels.expm1().view(5, 6, 32, 64).sum(1).round()
    wall, box = (counts[:, rows, 28:40] for rows in (slice(0, 8), slice(12, 20)))
    assert all(torch.equal(wall[k], wall[2]) for k in range(5))
    assert not torch.equal(box[1], box[2])
    assert wall[2].any() and box[2].any()


def test_the_depth_that_was_used_is_told_at_a_quarter_of_the_size(recording):
    world = recording()
    batch = whole(world, 3)
    depth = torch.from_numpy(world.depth[3][2::4, 2::4].astype(np.float32))
    torch.testing.assert_close(batch.taken_depth[0, 0], depth / depth.mean(), rtol=2e-3, atol=0)
    torch.testing.assert_close(batch.taken_ego[0], torch.from_numpy(true_motion(world, 3).twist[2]))


def test_shapes_and_types_of_a_drawn_batch(samples):
    batch = drawn(samples, 0, events=True)  # images that are smaller than a crop are padded
    maps = [(4, channels, 80, 96) for channels in (1, 1, 1, 2, 3)]
    assert [tuple(tensor.shape) for tensor in batch[:15]] == [
        (4, 30, 80, 96),
        (4, 24, 80, 96),
        (4, 30, 160, 192),
        (4, 24, 80, 96),
        (4, 6),
        (4, 1, 40, 48),
        (4, 4),
        (4, 1, 80, 96),
        (4, 4),
        *maps,
        (4, 6),
    ]
    assert batch.depth_valid.dtype == batch.moving.dtype == torch.bool
    assert all(tensor.dtype == torch.float32 for tensor in (*batch[:10], *batch[12:15]))
    assert drawn(samples, 0).events is None


def test_a_batch_depends_on_its_generator_alone(samples, small_crops):
    one, same, other = (drawn(samples, seed, events=True) for seed in (5, 5, 6))
    assert all(torch.equal(a, b) for a, b in zip((*one[:15], *one.events), (*same[:15], *same.events), strict=True))
    assert not torch.equal(one.voxels, other.voxels)


def test_events_lie_where_the_voxels_are(samples, small_crops):
    for seed in range(12):  # mirrored, reversed, or with polarities exchanged, or as they are
        batch = drawn(samples, seed, events=True)
        counted = torch.zeros(4, 2, 32, 64)
        number, x, y, t, positive = batch.events
        counted.index_put_((number, (~positive).long(), y.long(), x.long()), torch.ones(len(x)), accumulate=True)
        # A pixel of half the size holds its four pixels; events lie on pixel centres, a quarter from its own.
        on_each_side = batch.voxels.expm1()[:, 12:18].unflatten(1, (3, 2)).sum((1, 3, 4))
        torch.testing.assert_close(counted.sum((2, 3)), on_each_side, rtol=1e-4, atol=1e-3)
        assert t.abs().max() < 1e-6  # the known world's events are at the centre


def test_in_crops_that_are_turned_round_the_motion_field_still_holds(turning, monkeypatch):
    monkeypatch.setattr(module, "CROP", (96, 128))
    samples = samples_of([turning])
    seen = set()
    for seed in range(10):
        batch = drawn(samples, seed)
        known = batch.depth_valid.expand(-1, 2, -1, -1)
        error = (batch.flow - flow_that_follows(batch)).abs()[known]
        # Truth is that of one of a pixel's four: half a pixel beside its centre, which is 1/390 on the plane Z = 1.
        assert error.max() < 0.006
        seen |= {tuple(row) for row in batch.intrinsics[:, 2:].round().tolist()}
    assert len(seen) > 30  # crops from many places


def test_windows_are_inside_the_image_and_even(turning, monkeypatch):
    rng = np.random.default_rng(0)
    monkeypatch.setattr(module, "CROP", (96, 128))
    windows = [module._drawn_window((200, 261), rng) for _ in range(2000)]
    assert {window.top for window in windows} == set(range(0, 105, 2))
    assert {window.left for window in windows} == set(range(0, 133, 2))
    assert {window.size for window in windows} == {(96, 128)}
    assert module._drawn_window((60, 100), rng) == module.Window(0, 0, (96, 128))


def test_a_window_beyond_the_image_is_zero_there():
    image = np.arange(1.0, 25).reshape(4, 6)
    assert module.Window(0, 0, (4, 6)).half(image).tolist() == [[8, 10, 12], [20, 22, 24]]
    assert module.Window(2, 2, (4, 4)).half(image).tolist() == [[22, 24], [0, 0]]


def test_a_gyroscope_tells_the_rotation_of_some_samples(turning, monkeypatch):
    monkeypatch.setattr(module, "CROP", (32, 64))
    monkeypatch.setattr(module, "GYROSCOPE_RAD_S", 0)
    samples = samples_of([turning])
    batches = [drawn(samples, seed) for seed in range(40)]
    rotation, ego = (torch.cat([getattr(batch, name) for batch in batches]) for name in ("rotation", "ego"))
    known = rotation[:, 3] > 0
    assert known.float().mean().item() == pytest.approx(0.3, abs=0.12)
    torch.testing.assert_close(rotation[known, :3] * 40, ego[known, 3:])
    assert not rotation[~known].any()


def test_dropped_outer_slices(samples, small_crops):
    inner = replace(samples, index=samples.index[np.isin(samples.index[:, 1], (2, 3, 4))])  # those have all neighbours
    patterns = []
    for seed in range(60):
        there = drawn(inner, seed).voxels.unflatten(1, (5, 6)).flatten(2).any(2)
        patterns += [tuple(row) for row in there.int().tolist()]
    share = 1 - patterns.count((1, 1, 1, 1, 1)) / len(patterns)
    assert set(patterns) == {(1, 1, 1, 1, 1), (0, 1, 1, 1, 0), (0, 0, 1, 0, 0)}
    assert share == pytest.approx(0.15, abs=0.07)


def test_compensations_are_disturbed(samples, small_crops, monkeypatch):
    asked = []

    def exact(motion, rng, *, known_rotation):
        asked.append(known_rotation)
        return motion

    disturbed = drawn(samples, 1)
    monkeypatch.setattr(module, "disturbed", exact)
    told = drawn(samples, 1)
    assert not torch.equal(disturbed.taken_ego, told.taken_ego)
    assert len(asked) == 4
    assert isinstance(true_motion(samples.recordings[0], 0), StaticMotion)
