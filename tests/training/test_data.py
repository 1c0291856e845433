from dataclasses import replace

import numpy as np
import pytest
import torch
from torch.nn.functional import max_pool2d

from evimo.geometry.grids import normalised_grid, resized_intrinsics
from evimo.geometry.motion_field import motion_field
from evimo.training import data, disturbance
from evimo.training.data import drawn_row, drawn_sample, samples_of, stack_of, stacked, true_motion, whole_batch
from evimo.training.orientation import AS_FILMED

ABOVE = slice(0, 12)  # rows of the wall above the box of 36x54 px
INNER = slice(4, -4)  # columns whose dots neither came from the edge nor reach it


def drawn(samples, seed, *, size=4, **how):
    rng = np.random.default_rng(seed)
    return stacked([drawn_row(samples, rng) for _ in range(size)], **how)


def half_grid(batch):
    """Where each pixel of the truth looks."""
    return normalised_grid(resized_intrinsics(batch.intrinsics, (2, 2), (1, 1)), batch.depth)


def assert_flow_follows(batch):
    """From the batch's own depth, egomotion and object velocities."""
    twist = batch.ego[:, :, None, None].repeat(1, 1, *batch.depth.shape[-2:])
    twist[:, :3] -= batch.velocity
    known = batch.depth_valid
    flow = motion_field(twist, torch.where(known, 1 / batch.depth, 0), half_grid(batch))
    torch.testing.assert_close(batch.flow * known, flow * known, atol=2e-3, rtol=1e-3)


def test_every_slice_is_the_middle_of_one_sample(recording):
    samples = samples_of([recording(slices=3), recording(slices=2)])
    assert samples.index.tolist() == [[0, 0], [0, 1], [0, 2], [1, 0], [1, 1]]
    assert len(samples) == 5


def test_a_fingerprint_is_of_the_recordings_and_their_order(recording):
    one, same, other = (recording(seed=seed) for seed in (0, 0, 1))
    prints = [samples_of(worlds).fingerprint() for worlds in ([one, other], [same, other], [other, one], [one])]
    assert prints[0] == prints[1] and len(set(prints)) == 3


def test_recordings_without_events_have_no_samples(recording, without_events):
    dark = without_events(recording(slices=3))
    assert samples_of([dark, recording(slices=2), dark]).index.tolist() == [[1, 0], [1, 1]]
    assert samples_of([dark]).index.shape == (0, 2)


@pytest.mark.parametrize(("middle", "slices"), [(3, range(1, 6)), (0, range(3)), (6, range(4, 7))])
def test_a_stack_holds_the_slices_about_its_middle(middle, slices, recording):
    world = recording()
    stack = stack_of(world, middle)
    counts = [int(np.diff(world.event_first)[k]) for k in slices]
    assert len(stack.t) == sum(counts)
    begins = np.arange(slices.start, slices.stop + 1) - middle - 0.5
    assert np.histogram(stack.t, begins)[0].tolist() == counts
    # A dot of the wall is at a whole column when its slice is half over, and moves by a column per slice.
    wall = stack.y < 11.5
    off = (stack.x - stack.t)[wall & (stack.x > 0) & (stack.x < 53)]
    np.testing.assert_allclose(off, np.round(off), atol=0.01)


def test_a_stack_of_less_reach(recording):
    stack = stack_of(recording(), 3, reach=1)
    assert -1.5 <= stack.t.min() < -1.4 and 1.4 < stack.t.max() < 1.5


def test_convention_true_motion_is_in_mean_depths_per_slice(recording):
    world = recording()
    motion = true_motion(world, 3)
    wall = ~world.moving[3, 2::4, 2::4]
    for twist in motion.twist:  # by equation 1 the wall moves by one column per slice
        np.testing.assert_allclose(-twist[0] * motion.inv_depth[wall] * world.intrinsics[0], 1, rtol=1e-3)
    assert (1 / motion.inv_depth).mean() == pytest.approx(1, rel=1e-6)


def test_at_an_end_the_last_twist_goes_on_and_unknown_depth_is_the_mean(recording):
    world = recording()
    world.depth[0, :, :27] = 0
    world.ego[:, 4] = np.arange(7)
    motion = true_motion(world, 0)
    np.testing.assert_allclose(motion.twist[:, 4] / 0.025, (0, 0, 0, 1, 2), rtol=1e-6)
    assert (motion.inv_depth[:, :6] == 1).all()
    world.depth[0] = 0
    assert (true_motion(world, 0).inv_depth == 1).all()


@pytest.fixture
def whole(recording):
    """A known world and its middle slice as a batch, compensated by the true motion."""
    world = recording()
    return world, whole_batch(world, [3], [true_motion(world, 3)], 32)


def test_a_whole_batch_is_stored_truth_padded_to_the_stride(whole):
    world, batch = whole
    assert batch.sharp_voxels.shape[-2:] == (64, 64)
    inside = (..., slice(0, 18), slice(0, 27))
    assert torch.equal(batch.moving[inside][0, 0], torch.tensor(world.moving[3, 1::2, 1::2]))
    assert torch.equal(batch.depth[inside][0, 0], torch.tensor(world.depth[3, 1::2, 1::2].astype(np.float32)))
    assert torch.equal(batch.ego[0], torch.tensor(world.ego[3]))
    assert torch.equal(batch.intrinsics[0], torch.tensor(world.intrinsics))
    assert int(batch.valid.sum()) == int(batch.depth_valid.sum()) == 18 * 27
    assert batch.valid[inside].all() and batch.depth_valid[inside].all()
    assert not batch.rotation.any()
    assert_flow_follows(batch)


def test_the_true_motion_makes_the_wall_sharp(whole):
    """All five slices' events of a dot pile up where the dot is in the middle of the stack."""
    world, batch = whole
    piled = batch.sharp_voxels[0].expm1().unflatten(0, (15, 2)).sum(0)[:, ABOVE, :54]
    cut = slice(*world.event_first[3:5])
    (x, y), since, on = world.event_xy[cut].T / 64, world.event_t[cut] / 25_000 - 0.5, world.event_on[cut]
    edges = np.arange(13) - 0.5, np.arange(55) - 0.5
    dots = np.stack([np.histogram2d(y[side], (x - since)[side], edges)[0] for side in (on, ~on)])
    assert dots[..., INNER].max() == 1
    torch.testing.assert_close(piled[..., INNER], 5 * torch.tensor(dots[..., INNER]).float(), atol=0.2, rtol=0)


def test_the_second_pass_is_told_what_was_taken_out(whole):
    world, batch = whole
    motion = true_motion(world, 3)
    torch.testing.assert_close(batch.taken_ego[0], torch.tensor(motion.twist[2]), rtol=0.02, atol=0)
    torch.testing.assert_close(
        batch.taken_depth[0, 0, :9, :13], torch.tensor(1 / motion.inv_depth[:9, :13]), rtol=0.02, atol=0
    )
    assert batch.taken_depth.shape == (1, 1, 16, 16)


@pytest.fixture
def without_errors(monkeypatch):
    """Compensations by the truth."""
    monkeypatch.setattr(disturbance, "LEVELS", (1e-6, 1e-6))
    monkeypatch.setattr(disturbance, "FLAT", 0)
    monkeypatch.setattr(disturbance, "SMOOTH", (0.01, 0.01))


def test_convention_the_unit_of_what_is_taken_out_of_a_crop_is_its_own_mean_depth(recording, without_errors):
    """As in a run, whose image is the whole; the room is four times as deep on one side as on the other."""
    world = recording(size=(200, 400), slices=3, with_box=False)
    depth = np.tile(np.linspace(1, 4, 400), (3, 200, 1)).astype(np.float16)
    batch = drawn(samples_of([replace(world, depth=depth)]), 1, size=12)
    means = batch.depth.mean((1, 2, 3))
    assert batch.valid.all() and means.max() > 1.3 * means.min()
    torch.testing.assert_close(batch.taken_depth.mean((1, 2, 3)), torch.ones(12))
    torch.testing.assert_close(40 * batch.taken_ego[:, 0], batch.ego[:, 0] / means, rtol=0.02, atol=0)


def test_events_as_they_come_are_counted_at_half_the_size(whole):
    world, batch = whole
    counts = batch.voxels[0].expm1().unflatten(0, (5, 3, 2)).sum((1, 3, 4))
    by_slice = np.split(world.event_on, world.event_first[1:-1])[1:6]
    expected = [[on.sum(), (~on).sum()] for on in by_slice]
    torch.testing.assert_close(counts, torch.tensor(expected).float(), atol=0.01, rtol=1e-3)


def test_shapes_and_types_of_a_drawn_batch(samples):
    batch = drawn(samples, 0, events=True)
    shapes = {name: tuple(value.shape)[1:] for name, value in batch._asdict().items() if name != "events"}
    assert shapes == {
        "voxels": (30, 80, 96),
        "fits": (24, 80, 96),
        "candidates": (22, 40, 48),
        "sharp_voxels": (30, 160, 192),
        "sharp_fits": (24, 80, 96),
        "taken_ego": (6,),
        "taken_depth": (1, 40, 48),
        "rotation": (4,),
        "valid": (1, 80, 96),
        "intrinsics": (4,),
        "depth": (1, 80, 96),
        "depth_valid": (1, 80, 96),
        "moving": (1, 80, 96),
        "flow": (2, 80, 96),
        "velocity": (3, 80, 96),
        "ego": (6,),
    }
    flags = {"depth_valid", "moving"}
    for name in shapes:
        value = getattr(batch, name)
        assert len(value) == 4
        assert value.dtype == (torch.bool if name in flags else torch.float32), name
    assert drawn(samples, 0).events is None


@pytest.mark.parametrize("seed", range(6))
def test_a_small_image_is_padded_with_nothing(seed, samples):
    batch = drawn(samples, seed)
    assert batch.valid.sum((1, 2, 3)).tolist() == [18 * 27] * 4
    assert torch.equal(batch.valid > 0, batch.depth_valid)
    outside = max_pool2d(batch.valid, 3, 1, 1) == 0  # an event at the border is shared with the pixel beside it
    assert not (batch.voxels.sum(1, keepdim=True) * outside).any()
    assert_flow_follows(batch)


def test_a_large_image_is_cropped_and_intrinsics_go_along(recording):
    """Depth that says where a pixel looks, to the right or to the left, says so in every crop."""
    world = recording(size=(200, 250), slices=3)
    fx, fy, cx, cy = world.intrinsics
    row, column = np.mgrid[:200, :250]
    depth = 1 + np.abs(column - cx) / fx + 3 * np.abs(row - cy) / fy
    batch = drawn(samples_of([replace(world, depth=np.stack([depth] * 3).astype(np.float16))]), 0, size=12)
    assert batch.depth_valid.all() and batch.valid.all()
    x, y = half_grid(batch).abs().split(1, dim=1)
    torch.testing.assert_close(batch.depth, 1 + x + 3 * y, atol=0.02, rtol=0)
    assert len({tuple(row) for row in batch.intrinsics[:, 2:].tolist()}) > 8


def test_truth_lies_where_its_pixels_do_on_average(recording, monkeypatch):
    """It is read half a pixel of the image above or below, to the left or to the right of a pixel of half its size."""
    monkeypatch.setattr(data, "drawn_orientation", lambda rng: AS_FILMED)
    world = recording(size=(200, 250), slices=3)
    row, column = np.mgrid[:200, :250]
    for at, axis in ((column, 0), (row, 1)):
        depth = np.stack([1 + at / 128] * 3).astype(np.float16)  # exact in half precision
        batch = drawn(samples_of([replace(world, depth=depth)]), 3, size=40)
        expected = half_grid(batch)[:, axis] * world.intrinsics[axis] + world.intrinsics[2 + axis]
        off = (128 * (batch.depth[:, 0] - 1) - expected).mean((1, 2))
        torch.testing.assert_close(off.abs(), torch.full((40,), 0.5), atol=0.01, rtol=0)
        assert off.mean().abs() < 0.2


def test_a_batch_depends_on_its_generator_alone(samples):
    one, same, other = (drawn(samples, seed, events=True) for seed in (5, 5, 6))
    assert all(torch.equal(a, b) for a, b in zip((*one[:16], *one.events), (*same[:16], *same.events), strict=True))
    assert not torch.equal(one.voxels, other.voxels)


def test_events_are_those_of_the_middle_slice(samples):
    for seed in range(6):
        batch = drawn(samples, seed, events=True)
        counted = batch.voxels[:, 12:18].expm1().unflatten(1, (3, 2)).sum((1, 3, 4))
        number, x, y, t, positive = batch.events
        counts = torch.zeros(4, 2).index_put((number, (~positive).long()), torch.ones(len(x)), accumulate=True)
        torch.testing.assert_close(counts, counted, atol=0.01, rtol=1e-3)
        assert 0.012 < t.abs().max() < 0.012501
        assert batch.depth_valid[number, 0, (y / 2).long(), (x / 2).long()].all()


def test_dropped_outer_slices_have_no_events(recording):
    world, rng = recording(), np.random.default_rng(0)
    patterns = []
    for _ in range(150):
        voxels = drawn_sample(world, 3, rng)[0]
        patterns.append("".join("01"[int(each.any())] for each in voxels.reshape(5, -1)))
    assert set(patterns) == {"11111", "01110", "00100"}
    assert 1 - patterns.count("11111") / len(patterns) == pytest.approx(0.15, abs=0.08)


def test_some_samples_know_their_rotation(recording):
    world = recording()
    world.ego[:, 3:] = 0.9, -0.6, 0.7
    batch = drawn(samples_of([world]), 0, size=120)
    known = batch.rotation[:, 3] == 1
    assert known.float().mean().item() == pytest.approx(0.3, abs=0.12)
    assert not batch.rotation[~known].any()
    error = batch.rotation[known, :3] * 40 - batch.ego[known, 3:]
    assert error.square().mean().sqrt().item() == pytest.approx(0.02, rel=0.3)


def test_without_errors_what_is_taken_out_is_the_truth_in_every_orientation(samples, without_errors):
    for seed in range(6):
        batch = drawn(samples, seed)
        # The wall is 2 m away: the camera's speed in mean depths, at the wall's depth, is its speed in the wall's.
        wall = (batch.taken_depth * 0.999).flatten(1).amax(1)
        taken = batch.taken_ego[:, :3] / wall[:, None] * 2
        torch.testing.assert_close(taken * 40, batch.ego[:, :3], rtol=0.01, atol=1e-5)
