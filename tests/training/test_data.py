from dataclasses import replace

import numpy as np
import pytest
import torch

from evimo.geometry.grids import normalised_grid
from evimo.geometry.motion_field import motion_field
from evimo.geometry.warping import EventPoints
from evimo.training.batches import Batch
from evimo.training.data import batch_of, drawn_batch, mirrored, samples_of


def drawn(samples, seed, **how):
    return drawn_batch(samples, 4, np.random.default_rng(seed), **how)


def flow_that_follows(batch):
    """Flow from the batch's own depth, egomotion and object velocities."""
    twist = batch.ego[:, :, None, None].repeat(1, 1, *batch.depth.shape[-2:])
    twist[:, :3] -= batch.velocity
    return motion_field(twist, 1 / batch.depth, normalised_grid(batch.intrinsics, batch.depth))


@pytest.fixture
def world():
    """A batch with a random twist, random depth, and random velocities; its flow is what follows from them."""
    rng = torch.Generator().manual_seed(0)
    size = (6, 9)
    batch = Batch(
        frames=torch.rand(2, 5, 3, *size, generator=rng),
        valid=torch.ones(2, 1, *size),
        intrinsics=torch.tensor([[7.0, 6, 3.7, 2.9], [8.0, 8, 4, 2.5]]),
        depth=0.5 + torch.rand(2, 1, *size, generator=rng),
        depth_valid=torch.rand(2, 1, *size, generator=rng) > 0.2,
        moving=torch.rand(2, 1, *size, generator=rng) > 0.7,
        flow=torch.zeros(2, 2, *size),
        velocity=torch.randn(2, 3, *size, generator=rng),
        ego=torch.randn(2, 6, generator=rng),
        events=EventPoints(
            torch.tensor([0, 1]), torch.tensor([2.0, 8]), torch.tensor([1.0, 5]), torch.zeros(2), torch.ones(2).bool()
        ),
    )
    return batch._replace(flow=flow_that_follows(batch))


@pytest.mark.parametrize("axis", [0, 1])
def test_in_a_mirror_the_motion_field_still_holds(world, axis):
    other = mirrored(world, axis=axis)
    assert not torch.allclose(other.flow, world.flow)
    torch.testing.assert_close(other.flow, flow_that_follows(other), atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("axis", [0, 1])
def test_twice_mirrored_is_as_before(world, axis):
    back = mirrored(mirrored(world, axis=axis), axis=axis)
    torch.testing.assert_close(back[:9], world[:9])
    torch.testing.assert_close(tuple(back.events), tuple(world.events))


def test_a_mirror_along_x_exchanges_left_and_right(world):
    other = mirrored(world, axis=0)
    assert torch.equal(other.depth[..., 0], world.depth[..., -1])
    assert other.events.x.tolist() == [6, 0]
    assert other.events.y.tolist() == [1, 5]


def test_every_slice_is_the_middle_of_one_sample(recording):
    samples = samples_of([recording(slices=3), recording(slices=2)])
    assert samples.index.tolist() == [[0, 0], [0, 1], [0, 2], [1, 0], [1, 1]]
    assert len(samples) == 5


def test_a_batch_is_stored_truth_around_its_middle(samples):
    batch = batch_of(samples, [3, 7])
    world = samples.recordings[0]
    assert torch.equal(batch.frames[0], torch.tensor(world.frames[1:6].astype(np.float32)))
    assert torch.equal(batch.moving[0, 0], torch.tensor(world.moving[3]))
    assert torch.equal(batch.ego[0], torch.tensor(world.ego[3]))
    # The box moves, the wall does not; what each pixel shows flows as the motion field of its velocity says.
    torch.testing.assert_close(batch.flow, flow_that_follows(batch), atol=2e-3, rtol=1e-3)


def test_before_the_first_and_after_the_last_slice_frames_are_zero(samples):
    batch = batch_of(samples, [0, 6, 7])
    empty = ~batch.frames.flatten(2).any(2)
    assert empty.tolist() == [[True, True, False, False, False], [False, False, False, True, True]] + [
        [True, True, False, False, False]
    ]


def test_shapes_and_types_of_a_drawn_batch(samples):
    batch = drawn(samples, 0, events=True)
    shapes = [tuple(tensor.shape) for tensor in batch[:9]]
    maps = [(4, channels, 36, 54) for channels in (1, 1, 1, 2, 3)]
    assert shapes == [(4, 5, 3, 36, 54), (4, 1, 36, 54), (4, 4), *maps, (4, 6)]
    assert batch.depth_valid.dtype == batch.moving.dtype == torch.bool
    assert all(tensor.dtype == torch.float32 for tensor in batch[:4])
    assert drawn(samples, 0).events is None


def test_a_batch_depends_on_its_generator_alone(samples):
    one, same, other = (drawn(samples, seed, events=True) for seed in (5, 5, 6))
    assert all(torch.equal(a, b) for a, b in zip((*one[:9], *one.events), (*same[:9], *same.events), strict=True))
    assert not torch.equal(one.frames, other.frames)


def test_events_lie_where_the_frame_counts_are(samples):
    for seed in range(12):  # mirrored, or with polarities exchanged, or as they are
        batch = drawn(samples, seed, events=True)
        counted = torch.zeros(4, 2, 36, 54)
        number, x, y, t, positive = batch.events
        at = (number, (~positive).long(), y.long(), x.long())
        counted.index_put_(at, torch.ones(len(x)), accumulate=True)
        assert torch.equal(counted, batch.frames[:, 2, :2])
        assert t.abs().max() < 0.012501


def test_every_augmentation_is_drawn(samples):
    batches = [drawn(samples, seed) for seed in range(40)]
    centres = {tuple(row) for batch in batches for row in batch.intrinsics[:, 2:].tolist()}
    assert len(centres) == 2  # left-right; the principal point's row is in the middle
    directions = {float(torch.sign(batch.ego[0, 0])) for batch in batches}
    assert directions == {-1.0, 1.0}


def test_dropped_outer_slices_are_zero_frames(samples):
    inner = replace(samples, index=samples.index[np.isin(samples.index[:, 1], (2, 3, 4))])  # those have all neighbours
    patterns = []
    for seed in range(60):
        full = drawn(inner, seed).frames.flatten(2).any(2)
        patterns += [tuple(row) for row in full.int().tolist()]
    share = 1 - patterns.count((1, 1, 1, 1, 1)) / len(patterns)
    assert set(patterns) == {(1, 1, 1, 1, 1), (0, 1, 1, 1, 0), (0, 0, 1, 0, 0)}
    assert share == pytest.approx(0.2, abs=0.1)
