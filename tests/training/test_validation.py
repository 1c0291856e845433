from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from evimo.events.stack import StaticMotion
from evimo.model.first_pass import FirstAnswer
from evimo.model.motion_net import Prediction
from evimo.training.data import whole_batch
from evimo.training.validation import validated

SIZE = (32, 64)
WALL_M, BOX_M, BOX = 2.0, 1.0, (slice(8, 24), slice(16, 32))


@pytest.fixture
def world(recording):
    """A wall that flows, and a box that keeps its place in the image: the truth is the same in every slice."""
    made = recording(size=SIZE, slices=8)
    box = np.zeros((8, *SIZE), bool)
    box[:, *BOX] = True
    flow = np.zeros((8, 2, *SIZE), np.float16)
    flow[:, 0] = np.where(box, 0, 0.5)
    ego = np.tile(np.array((-1, 0.5, 0, 0.1, 0, 0.2), np.float32), (8, 1))
    depth = np.where(box, BOX_M, WALL_M).astype(np.float16)
    return replace(made, depth=depth, moving=box, ids=box.astype(np.uint8), flow=flow, ego=ego)


def oracle(world, *, called=None, share=1.0):
    """A stub that knows the world: `called` (h, w) is where it says something moves, `share` what of all motion."""
    truth = whole_batch(world, [0], [motion_of_nothing(world)], 32)
    mean = truth.depth.mean()
    called = truth.moving[0, 0] if called is None else called
    ego = truth.ego / torch.tensor([mean, mean, mean, 1, 1, 1]) * share
    to_px = truth.intrinsics[:, :2, None, None] / 40
    asked = []

    def first(voxels, fits, valid, intrinsics, rotation):
        asked.append(rotation)
        rigid = torch.tensor([0.5, 0]).view(1, 2, 1, 1).expand(1, 2, 8, 16) * to_px * share
        depth = (truth.depth / mean)[..., ::2, ::2]
        return FirstAnswer(depth, ego / 40, truth.flow[..., ::2, ::2] * to_px, rigid, valid[..., ::2, ::2])

    def second(voxels, fits, valid, taken, intrinsics, rotation):
        background = (~called)[None, None].float()
        mixture = torch.cat((background, 1 - background), dim=1)
        flow = truth.flow * share
        return [Prediction(truth.depth / mean, ego, torch.zeros(1, 1, 3), mixture, flow, flow, intrinsics, valid)]

    return SimpleNamespace(config=SimpleNamespace(stride=32), first=first, second=second, asked=asked)


def motion_of_nothing(world):
    return StaticMotion(np.zeros((5, 6), np.float32), np.ones((1, 1), np.float32), 1024, world.intrinsics)


@pytest.mark.parametrize("oracle_compensation", [False, True])
def test_who_knows_the_truth_is_right(world, oracle_compensation):
    scores = validated(oracle(world), [world], every=1, oracle=oracle_compensation)
    assert scores["iou"] == scores["event_iou"] == 1
    assert np.isnan(scores["alarms"])  # something moves in every slice
    for name in ("flow", "rotation", "translation"):
        assert scores[name] == pytest.approx(0, abs=1e-3)
    if not oracle_compensation:
        assert scores["first_static_flow"] == pytest.approx(0, abs=1e-3)


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_errors_are_shares_of_those_of_zero_motion(world, share):
    scores = validated(oracle(world, share=share), [world], every=1)
    for name in ("flow", "rotation", "translation"):
        assert scores[name] == pytest.approx(1 - share, rel=1e-3)


def test_half_the_box_is_half_the_iou(world):
    called = torch.zeros(16, 32, dtype=torch.bool)
    called[4:12, 8:12] = True
    scores = validated(oracle(world, called=called), [world], every=1)
    assert scores["iou"] == pytest.approx(0.5)
    assert scores["event_iou"] == pytest.approx(0.5, abs=0.1)  # dots are spread at random


def test_alarms_are_the_share_of_events_where_nothing_moves(world):
    still = replace(world, moving=np.zeros_like(world.moving))
    called = torch.zeros(16, 32, dtype=torch.bool)
    called[:4] = True
    scores = validated(oracle(still, called=called), [still], every=1)
    assert scores["alarms"] == pytest.approx(0.25, abs=0.05)
    assert np.isnan(scores["iou"])
    assert scores["event_iou"] == 0


def test_frames_count_alike_and_events_are_pooled(world):
    still = replace(world, moving=np.zeros_like(world.moving))
    called = torch.zeros(16, 32, dtype=torch.bool)
    called[4:12, 8:16] = True
    scores = validated(oracle(world, called=called), [world, still], every=1)
    assert scores["iou"] == 1
    assert scores["event_iou"] == pytest.approx(0.5, abs=1e-6)  # the other half is called in vain


def test_slices_at_the_ends_are_not_scored_and_recordings_without_events_neither(world, recording):
    model = oracle(world)
    validated(model, [world], every=2)
    assert len(model.asked) == 7  # slices 2 and 4, each with two neighbours to both sides: 0...6
    none = {name: getattr(world, name)[:0] for name in ("event_xy", "event_t", "event_on")}
    silent = replace(world, **none, event_first=np.zeros(9, np.int64))
    assert all(np.isnan(value) for value in validated(oracle(world), [silent]).values())


@pytest.mark.parametrize("gyroscope", [False, True])
def test_a_gyroscope_tells_the_true_rotation(world, gyroscope):
    model = oracle(world)
    validated(model, [world], gyroscope=gyroscope)
    expected = torch.tensor([[0.1 / 40, 0, 0.2 / 40, 1]]) * gyroscope
    assert all(torch.allclose(rotation, expected) for rotation in model.asked)
