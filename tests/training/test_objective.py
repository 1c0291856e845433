from math import log, pi

import numpy as np
import pytest
import torch

from evimo.errors import BadInput
from evimo.model.motion_net import Prediction
from evimo.training.data import batch_of, drawn_batch
from evimo.training.objective import at_scale, directions, objective, terms
from evimo.training.recipes import RECIPES, Recipe


@pytest.fixture
def batch(samples):
    return batch_of(samples, [2, 10])


def true_answer(batch, step, *, wrong=0.0):
    """What a perfect model says at a scale of `step` px per pixel; `wrong` spoils everything a little."""
    stride = step
    height, width = (side // step for side in batch.frames.shape[-2:])
    blank = torch.ones(2, 1, height, width)
    intrinsics = batch.intrinsics.clone()
    intrinsics[:, :2] /= step
    intrinsics[:, 2:] = (intrinsics[:, 2:] + 0.5) / step - 0.5
    empty = Prediction(blank, batch.ego, batch.ego, blank, blank, intrinsics, blank)
    here = at_scale(batch, empty, stride)
    mean = here.depth.mean((1, 2, 3), keepdim=True)
    mixture = torch.zeros(2, 4, height, width)
    mixture[:, :1] = (~here.moving).float()
    mixture[:, 2:] = here.moving / 2  # the box moves to the left, half way between the directions of channels 2 and 3
    scaled = torch.cat((batch.ego[:, :3] / mean[:, :, 0, 0], batch.ego[:, 3:]), dim=1)
    residual = torch.zeros(2, 3, 3)
    residual[:, 1:] = -(here.velocity.amin((2, 3)) / mean[:, :, 0, 0])[:, None]
    told = mixture * (1 - wrong) + wrong / 4
    answer = Prediction(here.depth / mean + wrong, scaled + wrong, residual, told, here.flow + wrong, intrinsics, blank)
    return answer, here, mean


def means(batch, answer, recipe):
    prediction, here, mean = answer
    return {name: values.mean().item() for name, values in terms(prediction, here, mean, recipe).items()}


def test_the_true_answer_costs_nothing(batch):
    found = means(batch, true_answer(batch, 2), RECIPES["shipped"])
    assert found.pop("depth") == pytest.approx(1)  # 1 is perfect there
    assert found.pop("direction") == pytest.approx(log(2), abs=0.01)  # shared by two channels
    smooth = {found.pop("mask_smoothness"), found.pop("depth_smoothness")}  # a true edge costs a little
    assert max(smooth) < 0.5
    assert {name: value for name, value in found.items() if value > 0.05} == {}


@pytest.mark.parametrize("name", sorted(RECIPES["shipped"].weights.keys() - {"mask_smoothness", "depth_smoothness"}))
def test_a_worse_answer_costs_more(name, batch):
    recipe = Recipe(weights={name: 1.0})
    right, wrong = (means(batch, true_answer(batch, 2, wrong=w), recipe)[name] for w in (0.0, 0.3))
    assert wrong > right + 0.01


def test_truth_at_a_scale_is_one_pixel_of_each_and_frames_are_averages(batch):
    _, here, _ = true_answer(batch, 6)
    assert here.depth.shape == (2, 1, 6, 9)
    assert torch.equal(here.depth[..., 1, 2], batch.depth[..., 9, 15])
    assert torch.equal(here.moving[..., 5, 8], batch.moving[..., 33, 51])
    torch.testing.assert_close(here.frames.mean((-2, -1)), batch.frames.mean((-2, -1)))


def test_padding_is_not_valid_and_not_known(samples, tiny):
    batch = batch_of(samples, [2])
    cropped = batch._replace(
        **{
            name: getattr(batch, name)[..., :30, :40]
            for name in ("frames", "valid", "depth", "depth_valid", "moving", "flow", "velocity")
        }
    )
    prediction = tiny()(cropped.frames, cropped.valid, cropped.intrinsics)[-1]
    here = at_scale(cropped, prediction, 18)
    assert here.valid.shape[-2:] == prediction.rel_depth.shape[-2:] == (18, 27)
    assert here.valid[..., :15, :20].all()
    assert not here.valid[..., 15:, :].any() and not here.depth_valid[..., 15:, :].any()
    assert not here.valid[..., 20:].any()


@pytest.mark.parametrize("count", [1, 3, 4])
def test_each_direction_has_its_own_channel(count):
    angle = torch.arange(count) * (2 * pi / count)
    velocity = torch.stack((angle.cos(), angle.sin(), torch.zeros(count)))[None, :, None]
    share = directions(velocity, count)[0, :, 0]
    torch.testing.assert_close(share.sum(0), torch.ones(count))
    assert share.argmax(0).tolist() == list(range(count))


@pytest.mark.parametrize("name", RECIPES)
def test_every_parameter_is_reached(name, samples, tiny):
    """Also by the paper's losses: flow and twist are supervised by warping, through the fits, at every scale."""
    model = tiny().train()
    batch = drawn_batch(samples, 2, np.random.default_rng(3), events=True)
    loss, said = objective(model, batch, RECIPES[name])
    loss.backward()
    unreached = [key for key, value in model.named_parameters() if value.grad is None or not value.grad.any()]
    assert unreached == []
    assert all(torch.isfinite(value.grad).all() for value in model.parameters())
    assert said.keys() == RECIPES[name].weights.keys()


def test_masks_wait_while_motion_is_trained_first(batch, tiny):
    model, recipe = tiny(), RECIPES["shipped"]
    with torch.no_grad():
        loss, said = objective(model, batch, recipe)
        without, _ = objective(model, batch, recipe, with_masks=False)
    assert (loss - without).item() == pytest.approx(said["mask"] + 0.7 * said["dice"], rel=1e-3)


def test_the_fine_warp_wants_events(batch, tiny):
    with pytest.raises(BadInput, match="events"):
        objective(tiny(), batch, RECIPES["paper"])


@pytest.mark.slow
def test_one_batch_overfits(batch, tiny):
    model, recipe = tiny(), RECIPES["shipped"]
    optimizer = torch.optim.Adam(model.parameters(), lr=1e-2, betas=(0.9, 0.99))

    def overlap():
        with torch.no_grad():
            told = 1 - model(batch.frames, batch.valid, batch.intrinsics)[-1].mixture[:, 0]
        moving = batch.moving[:, 0, ::2, ::2]
        return ((told > 0.5) & moving).sum() / ((told > 0.5) | moving).sum()

    before, first = overlap(), None
    for _ in range(60):
        loss, _ = objective(model, batch, recipe)
        first = loss.item() if first is None else first
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        optimizer.step()
    assert loss.item() < 0.5 * first
    assert overlap() > max(0.6, before + 0.2)
