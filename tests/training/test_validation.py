from dataclasses import replace

import numpy as np
import pytest
import torch

from evimo.geometry.camera import Camera
from evimo.geometry.grids import resized_intrinsics
from evimo.geometry.rectification import rectified
from evimo.model.backbone import enlarged
from evimo.model.motion_net import Prediction
from evimo.streaming.looks import Looks
from evimo.streaming.rotation import UNKNOWN
from evimo.training.data import stack_of, true_motion, whole_batch
from evimo.training.validation import validated

SHARES = ("flow", "static_flow", "rotation", "translation")


def perfect(world, middle, *, mixture=None):
    """A second pass that knows a slice's truth, or all but its mixture."""

    def second(voxels, fits, valid, taken, intrinsics, rotation):
        height, width = valid.shape[-2:]

        def padded(values):
            image = np.zeros((1, len(values), height, width), np.float32)
            inside = values[:, 1::2, 1::2]
            image[0, :, : inside.shape[1], : inside.shape[2]] = inside
            return torch.from_numpy(image)

        moving = padded(world.moving[middle][None])
        depth = world.depth[middle].astype(np.float32)
        mean = depth[1::2, 1::2].mean()
        ego = torch.tensor(world.ego[middle])[None] / torch.tensor([mean] * 3 + [1.0] * 3)
        shares = torch.cat((1 - moving, moving), dim=1) if mixture is None else mixture(moving)
        flow = padded(world.flow[middle])
        scale = resized_intrinsics(intrinsics, (2, 2), (1, 1))
        rel_depth, still = padded(depth[None]) / mean, torch.zeros(1, 1, 3)
        out = enlarged(taken.rigid, 2) / intrinsics[:, :2, None, None] * 40
        return [Prediction(rel_depth, ego, still, shares, flow, out, valid, scale, valid)]

    return second


@pytest.fixture
def scores(tiny, monkeypatch):
    """Scores of a model whose second pass is another."""

    def of_second(second, world, **how):
        model = tiny().eval()
        monkeypatch.setattr(model, "second", second)
        return validated(model, [world], **how)

    return of_second


def test_the_share_that_the_lens_sees_is_a_runs_also_where_sides_are_odd(recording, tiny, monkeypatch):
    """Of 35x53 px, in part unseen: what a run shows to the passes, what batches show, and what validation does."""
    world = recording(size=(35, 53), slices=5)
    world.valid[:5, :9] = np.random.default_rng(0).random((5, 9)) < 0.5
    model = tiny().eval()
    image = rectified(Camera(40.0, 40.0, 26.0, 17.0, 35, 53))
    looks = Looks(replace(image, image_valid=world.valid), stride=model.config.stride)
    expected = looks.first(stack_of(world, 2), UNKNOWN).valid
    assert set(np.unique(expected)) == {0, 0.25, 0.5, 0.75, 1}
    batch = whole_batch(world, [2], [true_motion(world, 2)], model.config.stride)
    shown, first = [], model.first
    monkeypatch.setattr(model, "first", lambda *inputs: shown.append(inputs[3]) or first(*inputs))
    validated(model, [world])
    for valid in (batch.valid, *shown):
        np.testing.assert_array_equal(valid[0, 0], expected)
    assert len(shown) == 5


def test_an_untrained_model_has_finite_scores(recording, tiny, without_events):
    worlds = [recording(slices=6), recording(slices=6, seed=1, with_box=False), without_events(recording())]
    for world in worlds:
        world.ego[:, 4] = 0.2
    found = validated(tiny().eval(), worlds, every=1)
    assert np.isfinite(list(found.values())).all()
    for name in ("iou", "event_iou", "alarms"):
        assert 0 <= found[name] <= 1
    assert all(found[name] > 0.01 for name in SHARES)


def test_the_truth_has_the_best_scores(recording, scores):
    world = recording(slices=5)  # one of which is scored
    found = scores(perfect(world, 2), world, oracle=True)
    assert found["iou"] == found["event_iou"] == 1
    assert found["flow"] < 1e-3 and found["translation"] < 1e-3
    assert np.isnan(found["alarms"]) and np.isnan(found["rotation"])  # something moves always; nothing turns


@pytest.mark.parametrize(("called", "alarms"), [(0.0, 0.0), (1.0, 1.0)])
def test_alarms_are_the_events_called_moving_where_nothing_moves(called, alarms, recording, scores):
    world = recording(slices=5, with_box=False)

    def mixture(moving):
        return torch.cat((0 * moving + 1 - called, 0 * moving + called), dim=1)

    found = scores(perfect(world, 2, mixture=mixture), world, oracle=True)
    assert found["alarms"] == pytest.approx(alarms)
    assert np.isnan(found["iou"])


def test_called_half_of_what_moves(recording, scores):
    """The upper half of the box: 6 of its 12 rows."""
    world = recording(slices=5)

    def mixture(moving):
        upper = moving * (torch.arange(moving.shape[2]) < 9)[:, None]
        return torch.cat((1 - upper, upper), dim=1)

    found = scores(perfect(world, 2, mixture=mixture), world, oracle=True)
    assert found["iou"] == pytest.approx(0.5)
    assert found["event_iou"] == pytest.approx(0.5, abs=0.1)


def test_the_oracles_static_flow_is_the_truth_where_nothing_moves(recording, scores):
    world = recording(slices=5, with_box=False)
    assert scores(perfect(world, 2), world, oracle=True)["static_flow"] < 1e-3
    assert scores(perfect(world, 2), world)["static_flow"] > 0.01  # of an untrained first pass, aligned


def test_a_gyroscope_says_the_rotation(recording, tiny):
    world = recording(slices=5)
    world = replace(world, ego=world.ego + np.array((0, 0, 0, 0.3, -0.8, 0.5), np.float32))
    known, unknown = (validated(tiny().eval(), [world], gyroscope=gyroscope)["rotation"] for gyroscope in (True, False))
    assert known < 0.05 < 0.3 < unknown


def test_depth_is_scored_at_the_median_scale(recording, scores):
    """Half of all pixels at 1.5 times their depth, more than half right: AbsRel is their share times a half."""
    world = recording(size=(64, 64), with_box=False)
    right = perfect(world, 3)

    def second(*asked):
        (said,) = right(*asked)
        wrong = said.rel_depth.clone()
        wrong[..., :8, :] *= 1.5
        return [said._replace(rel_depth=wrong)]

    assert scores(right, world, every=20)["depth"] == pytest.approx(0, abs=1e-3)
    assert scores(second, world, every=20)["depth"] == pytest.approx(0.5 * 8 / 32, abs=1e-3)


def test_a_true_translation_is_right_where_the_depth_of_objects_alone_is_known(recording, scores):
    """The box is at half the wall's distance: what is known of depth says nothing of the mean that is the unit."""
    world = recording(slices=5)
    part = replace(world, depth=np.where(world.moving, world.depth, 0).astype(np.float16))
    assert scores(perfect(world, 2), part)["translation"] < 1e-3
    none = replace(world, depth=np.zeros_like(world.depth))
    found = scores(perfect(world, 2), none)
    assert np.isnan(found["translation"])
