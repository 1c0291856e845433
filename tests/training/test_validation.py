from dataclasses import replace

import numpy as np
import pytest
import torch

from evimo.geometry.grids import resized_intrinsics
from evimo.model.motion_net import Prediction
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
        return [Prediction(padded(depth[None]) / mean, ego, torch.zeros(1, 1, 3), shares, flow, flow, scale, valid)]

    return second


@pytest.fixture
def scores(tiny, monkeypatch):
    """Scores of a model whose second pass is another."""

    def of_second(second, world, **how):
        model = tiny().eval()
        monkeypatch.setattr(model, "second", second)
        return validated(model, [world], **how)

    return of_second


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
