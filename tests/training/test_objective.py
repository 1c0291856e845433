from dataclasses import dataclass
from math import log, pi
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode

from evimo.errors import BadInput
from evimo.geometry.grids import resized_intrinsics
from evimo.geometry.warping import EventPoints
from evimo.losses.depth import mean_over
from evimo.model.first_pass import FirstAnswer
from evimo.model.motion_net import Prediction
from evimo.model.networks import compute_in
from evimo.training.batches import Batch
from evimo.training.data import drawn_row, stacked, true_motion, whole_batch
from evimo.training.objective import at_scale, directions, first_terms, objective, slice_counts, taken_out, terms
from evimo.training.recipes import RECIPES, Recipe

SHIPPED, PAPER = RECIPES["shipped"], RECIPES["paper"]


@pytest.fixture
def batch(recording):
    """Two slices of a known world of 64x96 px, which needs no padding."""
    world = recording(size=(64, 96), slices=7)
    return whole_batch(world, (2, 4), [true_motion(world, k) for k in (2, 4)], 32)


@dataclass
class Answer:
    """What a model says at a scale, the batch brought there, and the truth's mean depth, its unit."""

    prediction: Prediction
    here: Batch
    unit: Tensor

    def costs(self, recipe):
        found = terms(self.prediction, self.here, self.unit, recipe)
        return {name: values.mean().item() for name, values in found.items()}


def true_answer(batch, step, *, wrong=0.0):
    """Of a perfect model, one pixel per `step` of the finest answer; `wrong` spoils everything a little."""
    height, width = (side // step for side in batch.valid.shape[-2:])
    blank = torch.ones(2, 1, height, width)
    intrinsics = resized_intrinsics(batch.intrinsics, (2 * step, 2 * step), (1, 1))
    nothing = torch.zeros(2, 2, height, width)
    here = at_scale(batch, Prediction(blank, batch.ego, batch.ego, blank, nothing, nothing, blank, intrinsics, blank))
    mean = mean_over(batch.depth, batch.depth_valid)
    mixture = torch.zeros(2, 4, height, width)
    mixture[:, :1] = (~here.moving).float()
    mixture[:, 2:] = here.moving / 2  # the box moves to the left, half way between the directions of channels 2 and 3
    scaled = torch.cat((batch.ego[:, :3] / mean[:, :, 0, 0], batch.ego[:, 3:]), dim=1)
    residual = torch.zeros(2, 3, 3)
    residual[:, 1:] = -(here.velocity.amin((2, 3)) / mean[:, :, 0, 0])[:, None]
    prediction = Prediction(
        rel_depth=here.depth / mean + wrong,
        ego=scaled + wrong,
        residual=residual,
        mixture=mixture * (1 - wrong) + wrong / 4,
        seen=here.flow + wrong,
        taken=here.flow.roll(1, 0) / 2,  # whatever was taken out
        confidence=blank,
        intrinsics=intrinsics,
        valid=blank,
    )
    return Answer(prediction, here, mean)


@pytest.mark.parametrize("step", [1, 2])
def test_the_true_answer_costs_nothing(step, batch):
    found = true_answer(batch, step).costs(Recipe(weights={**SHIPPED.weights, "flow": 1.0}, moving_share=0.15))
    assert found.pop("depth") == pytest.approx(1)  # 1 is perfect there
    assert found.pop("direction") == pytest.approx(log(2), abs=0.01)  # shared by two channels
    assert found.pop("mask_smoothness") < 0.5  # a true edge costs a little
    assert found == pytest.approx(dict.fromkeys(found, 0), abs=2e-3)
    assert {"seen", "flow", "twist", "velocity", "mask", "dice"} == found.keys()


@pytest.mark.parametrize("name", ["mask", "mask_one_sided", "dice", "depth", "seen"])
def test_nothing_is_learned_where_the_lens_sees_a_pixel_in_part_and_truth_is_unknown(name, batch):
    answer = true_answer(batch, 1)
    valid, known = answer.here.valid.clone(), answer.here.depth_valid.clone()
    valid[..., -1], known[..., -1] = 0.5, False
    answer.here = answer.here._replace(valid=valid, depth_valid=known)
    recipe = Recipe(weights={name: 1.0}, moving_share=0.15)
    right = answer.costs(recipe)[name]
    spoilt = {field: getattr(answer.prediction, field).clone() for field in ("mixture", "rel_depth", "seen")}
    for values in spoilt.values():
        values[..., -1] += 0.4
    answer.prediction = answer.prediction._replace(**spoilt)
    assert answer.costs(recipe)[name] == right


@pytest.mark.parametrize("name", sorted(SHIPPED.weights.keys() - {"mask_smoothness"} | {"flow", "mask_one_sided"}))
def test_a_worse_answer_costs_more(name, batch):
    recipe = Recipe(weights={name: 1.0}, moving_share=0.15)
    right, wrong = (true_answer(batch, 2, wrong=w).costs(recipe)[name] for w in (0.0, 0.3))
    assert wrong > right + 0.01


def warp_costs(world, name, events=None):
    """Of the true egomotion, and of none, in a world where nothing moves but the camera."""
    batch = whole_batch(world, (2, 4), [true_motion(world, k) for k in (2, 4)], 32)._replace(events=events)
    answer = true_answer(batch, 1)
    right = answer.costs(Recipe(weights={name: 1.0}))[name]
    answer.prediction = answer.prediction._replace(ego=0 * answer.prediction.ego)
    return right, answer.costs(Recipe(weights={name: 1.0}))[name]


def test_slices_warped_by_the_true_flow_agree_best(recording):
    right, still = warp_costs(recording(size=(64, 96), with_box=False), "coarse_warp")
    assert right < 0.8 * still


def test_events_warped_by_the_true_flow_pile_up(recording):
    """Five events of a dot of the wall, which moves by 1 px of the whole image per slice: where they meet, each costs
    1 / sqrt(5). Where they are one pixel apart, 1 each.
    """
    t = torch.arange(-4, 5.0, 2) * 0.025
    x, row = 40.5 + t / 0.025, torch.full((5,), 20.5)
    twice = [torch.cat((each, each)) for each in (x, row, t)]
    events = EventPoints(torch.arange(2).repeat_interleave(5), *twice, torch.ones(10, dtype=torch.bool))
    right, still = warp_costs(recording(size=(64, 96), with_box=False), "fine_warp", events)
    assert right == pytest.approx(5**-0.5, rel=0.05)
    assert still == pytest.approx(1, rel=0.05)


def test_truth_at_a_scale_is_one_pixel_of_each_and_events_are_averages(batch):
    here = true_answer(batch, 4).here
    assert here.depth.shape == (2, 1, 8, 12)
    assert torch.equal(here.depth[..., 1, 2], batch.depth[..., 6, 10])
    assert torch.equal(here.moving[..., 5, 8], batch.moving[..., 22, 34])
    torch.testing.assert_close(here.voxels.mean((-2, -1)), batch.voxels.expm1().mean((-2, -1)))


def one_event(batch, channel, *, moving):
    """The batch with one event at row 10, column 20; everything stands still, and the model says 3 px per slice."""
    answer = true_answer(batch, 1)
    voxels = torch.zeros_like(batch.voxels)
    voxels[:, channel, 10, 20] = 1
    still = torch.zeros_like(batch.flow)
    here = answer.here._replace(
        voxels=voxels,
        flow=still,
        moving=torch.full_like(batch.moving, moving),
        depth_valid=torch.ones_like(batch.depth_valid),
    )
    px = 40 / answer.prediction.intrinsics[:, :1, None, None]
    seen = torch.cat((3 * px + 0 * still[:, :1], still[:, :1]), dim=1)
    prediction = answer.prediction._replace(seen=seen, taken=still)
    return terms(prediction, here, answer.unit, Recipe(weights={"seen": 1.0}))["seen"][0, 0]


@pytest.mark.parametrize(("moving", "far", "near"), [(False, 0.3, 1.8), (True, 0.9, 5.4)])
def test_a_flow_error_counts_near_events_and_on_movers(moving, far, near, batch):
    """3 px at a knee of 3 px are 1.5; that counts 0.2, or 1.2 beside an event, and three times on what moves."""
    for channel in (12, 17):  # the first and the last of the middle slice
        cost = one_event(batch, channel, moving=moving)
        expected = torch.full_like(cost, far)
        expected[9:12, 19:22] = near
        torch.testing.assert_close(cost, expected, rtol=1e-4, atol=1e-5)
    for channel in (11, 18):  # of its neighbours
        torch.testing.assert_close(one_event(batch, channel, moving=moving), torch.full_like(cost, far))


def test_a_flow_error_is_of_what_is_left(batch):
    """Where 3 px per slice were taken out, nothing that is left is the truth; what was taken is no error."""
    answer = true_answer(batch, 1)
    taken = answer.here.flow * 0.9
    prediction = answer.prediction._replace(seen=answer.here.flow * 0.9, taken=taken)
    whole = answer.prediction._replace(seen=answer.here.flow * 0.9, taken=taken * 0)
    recipe = Recipe(weights={"seen": 1.0})
    costs = [terms(each, answer.here, answer.unit, recipe)["seen"].mean() for each in (prediction, whole)]
    assert costs[0] > 1.2 * costs[1]  # small errors beside nothing count more than beside a fast flow


@pytest.mark.parametrize("count", [1, 3, 4])
def test_each_direction_has_its_own_channel(count):
    angle = torch.arange(count) * (2 * pi / count)
    velocity = torch.stack((angle.cos(), angle.sin(), torch.zeros(count)))[None, :, None]
    share = directions(velocity, count)[0, :, 0]
    torch.testing.assert_close(share.sum(0), torch.ones(count))
    assert share.argmax(0).tolist() == list(range(count))


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_every_direction_is_shared_out(count):
    angle = torch.linspace(-3.1, 3.1, 63)
    velocity = torch.stack((angle.cos(), angle.sin(), torch.zeros(63)))[None, :, None]
    torch.testing.assert_close(directions(velocity, count).sum(1), torch.ones(1, 1, 63))


def test_slices_are_counted_by_polarity():
    counts = torch.zeros(1, 30, 2, 3)
    counts[0, 6, 1, 2], counts[0, 11, 1, 2] = 2, 1  # slice 1: two positive in the first bin, a negative in the last
    by_slice = slice_counts(counts)
    assert by_slice.shape == (1, 5, 2, 2, 3)
    assert by_slice[0, 1, :, 1, 2].tolist() == [2, 1]
    by_slice[0, 1, :, 1, 2] = 0
    assert not by_slice.any()


def first_answer(batch, *, wrong=0.0):
    """What a perfect first pass says, on one in 2x2 pixels of the truth."""
    here = at_scale(batch, true_answer(batch, 2).prediction)
    mean = mean_over(batch.depth, batch.depth_valid)
    ego = torch.cat((batch.ego[:, :3] / mean[:, :, 0, 0], batch.ego[:, 3:]), dim=1) / 40 + wrong / 40
    flow = here.flow * batch.intrinsics[:, :2, None, None] / 40 + wrong
    return FirstAnswer(here.depth / mean + wrong, ego, flow, here.valid)


def first_costs(batch, recipe, **how):
    return {name: v.mean().item() for name, v in first_terms(first_answer(batch, **how), batch, recipe).items()}


def test_a_true_first_answer_costs_nothing(batch):
    """Its static flow is right where nothing moves, and counts nowhere else."""
    found = first_costs(batch, SHIPPED)
    assert found.pop("depth") == pytest.approx(1)
    assert found == pytest.approx({"seen": 0, "rigid": 0, "twist": 0}, abs=2e-3)


@pytest.mark.parametrize("known", ["moving", "depth_valid"])
def test_a_true_answer_costs_nothing_where_the_depth_of_objects_alone_is_known(known, batch):
    """As in EV-IMO: the box is at half the distance of the wall, and an answer's depths are about the mean of all."""
    said = [true_answer(batch, step).prediction for step in (2, 1)]
    model = SimpleNamespace(first=lambda *_: first_answer(batch), second=lambda *_: said)
    here = getattr(batch, known)
    _, found = objective(model, batch._replace(depth_valid=here), SHIPPED)
    for name in ("first_depth", "depth"):
        assert found[name].item() == pytest.approx(here.float().mean().item(), abs=0.02)  # 1 where it is known
    for name in ("first_twist", "twist", "velocity"):
        assert found[name].item() == pytest.approx(0, abs=2e-3), name


def test_without_any_depth_the_rotation_alone_is_compared(batch):
    answer = true_answer(batch, 1)
    answer.here = answer.here._replace(depth_valid=torch.zeros_like(answer.here.depth_valid))
    for wrong, cost in (((5.0, -3, 2, 0, 0, 0), 0), ((0, 0, 0, 0, 0.6, 0), 0.6)):
        ego = (answer.prediction.ego + torch.tensor(wrong)).requires_grad_()
        found = terms(answer.prediction._replace(ego=ego), answer.here, answer.unit, Recipe(weights={"twist": 1.0}))
        size = 1 + (ego[:, :3]).detach().norm(dim=1).mean().item()  # nothing turns
        assert found["twist"].mean().item() * size == pytest.approx(cost, rel=0.05, abs=1e-6)
        found["twist"].mean().backward()
        assert torch.isfinite(ego.grad).all() and not ego.grad[:, :3].any()


@pytest.mark.parametrize("name", SHIPPED.first)
def test_a_worse_first_answer_costs_more(name, batch):
    right, wrong = (first_costs(batch, Recipe(first={name: 1.0}), wrong=w)[name] for w in (0.0, 0.3))
    assert wrong > right + 0.01


def test_what_is_taken_out_is_the_flow_of_the_static_world(batch):
    """The wall moves by 1 px per slice, and something static at the box's depth, half as far, would by 2."""
    first = first_answer(batch)
    first = first._replace(flow=first.flow.clone().requires_grad_())
    taken = taken_out(batch, first)
    moving = batch.moving[:, 0, 1::2, 1::2]
    torch.testing.assert_close(taken.rigid[:, 0], 1 + moving.float(), rtol=2e-3, atol=2e-3)
    assert taken.rigid[:, 1].abs().max() < 1e-4
    assert torch.equal(taken.seen, first.flow) and not taken.seen.requires_grad
    assert torch.equal(taken.ego, batch.taken_ego)


@pytest.mark.parametrize("name", ["paper", "shipped"])
def test_every_parameter_is_reached(name, samples, tiny, small_crops):
    """Also by the paper's losses: flow and twist are supervised by warping, through the fits, in both passes."""
    model = tiny().train()
    rng = np.random.default_rng(3)
    batch = stacked([drawn_row(samples, rng) for _ in range(2)], events=True)
    loss, said = objective(model, batch, RECIPES[name])
    loss.backward()
    unreached = [key for key, value in model.named_parameters() if value.grad is None or not value.grad.any()]
    assert unreached == []
    assert all(torch.isfinite(value.grad).all() for value in model.parameters())
    assert said.keys() == RECIPES[name].weights.keys() | {f"first_{term}" for term in RECIPES[name].first}


def test_the_loss_is_the_weighted_sum_of_what_it_says(batch, tiny):
    with torch.no_grad():
        loss, said = objective(tiny(), batch, SHIPPED)
    weights = SHIPPED.weights | {f"first_{name}": weight for name, weight in SHIPPED.first.items()}
    assert loss.item() == pytest.approx(sum(weights[name] * value.item() for name, value in said.items()), rel=1e-4)


def test_the_first_pass_learns_nothing_from_the_second(batch, tiny):
    model = tiny()
    loss, _ = objective(model, batch, Recipe(weights=SHIPPED.weights, moving_share=0.15))
    loss.backward()
    assert all(value.grad is None or not value.grad.any() for value in model.first_pass.parameters())
    assert any(value.grad.any() for value in model.second_pass.parameters())


def test_the_fine_warp_wants_events(batch, tiny):
    with pytest.raises(BadInput, match="events"):
        objective(tiny(), batch, PAPER)


@pytest.mark.parametrize("name", ["paper", "shipped"])
def test_the_loss_of_a_batch_is_the_mean_of_its_samples(name, samples, tiny, small_crops):
    """So that processes may share a batch: neither the network nor a loss mixes samples, nor weighs them."""
    model, rng = tiny().train(), np.random.default_rng(4)
    rows = [drawn_row(samples, rng) for _ in range(3)]

    def learned(rows):
        model.zero_grad()
        loss, _ = objective(model, stacked(rows, events=True), RECIPES[name])
        loss.backward()
        return torch.cat((loss.detach()[None], *(value.grad.flatten() for value in model.parameters())))

    alone = torch.stack([learned([row]) for row in rows]).mean(0)
    torch.testing.assert_close(learned(rows), alone, rtol=1e-3, atol=1e-4)


class FromHost(TorchDispatchMode):
    """Notes what a CUDA graph cannot hold: numbers for Python, tensors of its lists, masks as indices."""

    def __init__(self):
        super().__init__()
        self.found = []

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):
        name = func.overloadpacket.__name__
        masks = [each for each in args[1] if each is not None] if name == "index" else []
        if name in ("_local_scalar_dense", "nonzero", "lift_fresh") or any(m.dtype == torch.bool for m in masks):
            self.found.append(name)
        return func(*args, **(kwargs or {}))


def test_a_step_asks_nothing_of_the_host(batch, tiny):
    model = compute_in(tiny().train(), torch.bfloat16)
    with FromHost() as mode:
        loss, _ = objective(model, batch, SHIPPED)
        loss.backward()
        assert mode.found == []
        loss.item()
    assert mode.found == ["_local_scalar_dense"]


@pytest.mark.slow
def test_one_batch_overfits(batch, tiny):
    model = tiny()
    optimizer = torch.optim.Adam(model.parameters(), lr=1e-2, betas=(0.9, 0.99))

    def overlap():
        with torch.no_grad():
            first = model.first(*batch[:3], batch.valid, batch.intrinsics, batch.rotation)
            taken = taken_out(batch, first)
            sharp = batch.sharp_voxels, batch.sharp_fits, batch.valid
            told = model.second(*sharp, taken, batch.intrinsics, batch.rotation)[-1].mixture[:, :1] < 0.5
        return float((told & batch.moving).sum() / (told | batch.moving).sum())

    before, first = overlap(), None
    for _ in range(60):
        loss, _ = objective(model, batch, SHIPPED)
        first = loss.item() if first is None else first
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        optimizer.step()
    assert loss.item() < 0.5 * first
    assert overlap() > max(0.6, before + 0.2)
