from math import log, pi

import numpy as np
import pytest
import torch

from evimo.errors import BadInput
from evimo.model.first_pass import FirstAnswer
from evimo.model.motion_net import Prediction
from evimo.training.data import drawn_batch, true_motion, whole_batch
from evimo.training.objective import at_scale, directions, first_terms, objective, slice_frames, taken_out, terms
from evimo.training.recipes import RECIPES, Recipe


@pytest.fixture
def batch(recording):
    world = recording()
    return whole_batch(world, [2, 3], [true_motion(world, k) for k in (2, 3)], 32)


def empty_answer(batch, step):
    """A prediction whose pixels are `step` px of the rectified image; it says nothing."""
    count, _, height, width = batch.sharp_voxels.shape
    blank = torch.ones(count, 1, height // step, width // step)
    intrinsics = batch.intrinsics.clone()
    intrinsics[:, :2] /= step
    intrinsics[:, 2:] = (intrinsics[:, 2:] + 0.5) / step - 0.5
    still = blank.repeat(1, 2, 1, 1) * 0
    return Prediction(
        blank, batch.ego * 0, torch.zeros(count, 3, 3), blank.repeat(1, 4, 1, 1) / 4, still, still, intrinsics, blank
    )


def true_answer(batch, step, *, wrong=0.0):
    """What a perfect model says at a scale; `wrong` spoils everything a little."""
    empty = empty_answer(batch, step)
    here = at_scale(batch, empty)
    mean = here.depth.mean((1, 2, 3), keepdim=True)
    mixture = torch.zeros_like(empty.mixture)
    mixture[:, :1] = (~here.moving).float()
    mixture[:, 2:] = here.moving / 2  # the box moves to the left, half way between the directions of channels 2 and 3
    scaled = torch.cat((batch.ego[:, :3] / mean[:, :, 0, 0], batch.ego[:, 3:]), dim=1)
    residual = torch.zeros(2, 3, 3)
    residual[:, 1:] = -(here.velocity.amin((2, 3)) / mean[:, :, 0, 0])[:, None]
    answer = empty._replace(
        rel_depth=here.depth / mean + wrong,
        ego=scaled + wrong,
        residual=residual,
        mixture=mixture * (1 - wrong) + wrong / 4,
        seen=here.flow + wrong,
    )
    return answer, here, mean


def means(batch, answer, recipe):
    prediction, here, mean = answer
    return {name: values.mean().item() for name, values in terms(prediction, here, mean, recipe).items()}


def test_the_true_answer_costs_nothing(batch):
    found = means(batch, true_answer(batch, 2), RECIPES["shipped"])
    assert found.pop("depth") == pytest.approx(1)  # 1 is perfect there
    assert found.pop("direction") == pytest.approx(log(2), abs=0.01)  # shared by two channels
    assert found.pop("mask_smoothness") < 0.5  # a true edge costs a little
    assert {name: value for name, value in found.items() if value > 0.05} == {}


@pytest.mark.parametrize("name", sorted({*RECIPES["shipped"].weights, "flow", "mask_one_sided"} - {"mask_smoothness"}))
def test_a_worse_answer_costs_more(name, batch):
    recipe = Recipe(weights={name: 1.0})
    right, wrong = (means(batch, true_answer(batch, 2, wrong=w), recipe)[name] for w in (0.0, 0.3))
    assert wrong > right + 0.01


def first_answer(batch, *, wrong=0.0):
    """What a perfect first pass says, of everything that flows and of what stands still."""
    answer, here, mean = true_answer(batch, 4)
    to_px = batch.intrinsics[:, :2, None, None] / 40
    still = torch.where(here.moving, 0, here.flow)
    return FirstAnswer(
        answer.rel_depth + wrong, (answer.ego + wrong) / 40, (here.flow + wrong) * to_px, still * to_px, answer.valid
    ), mean


@pytest.mark.parametrize("name", sorted(RECIPES["shipped"].first))
def test_the_first_pass_costs_nothing_where_it_is_right(name, batch):
    recipe = Recipe(first={name: 1.0})
    (right, mean), (wrong, _) = first_answer(batch), first_answer(batch, wrong=0.3)
    costs = [first_terms(answer, batch, mean, recipe)[name].mean().item() for answer in (right, wrong)]
    assert costs[0] == pytest.approx(1 if name == "depth" else 0, abs=0.02)
    assert costs[1] > costs[0] + 0.01


def test_what_moves_costs_the_static_flow_nothing(batch):
    """The first pass's static flow is judged where nothing moves by itself."""
    answer, mean = first_answer(batch)
    cost = first_terms(answer, batch, mean, Recipe(first={"rigid": 1.0}))["rigid"]
    moving = at_scale(batch, empty_answer(batch, 4)).moving
    assert moving.any() and not cost[moving].any()


def test_a_flow_error_counts_near_events_and_on_movers(batch):
    """0.2 far from events, 1.2 near them, and each three times on what moves."""
    voxels = torch.zeros_like(batch.voxels)
    voxels[:, 14, 8, 16] = voxels[:, 14, 2, 3] = log(2)  # an event on the box and one on the wall
    voxels[:, 5] = voxels[:, 20] = log(3)  # other slices have nothing to say
    moving = torch.zeros_like(batch.moving)
    moving[..., 6:12, 14:20] = True
    nothing = torch.zeros_like(batch.flow)
    spoiled = batch._replace(voxels=voxels, moving=moving, flow=nothing)
    prediction = empty_answer(spoiled, 2)
    here = at_scale(spoiled, prediction)
    to_px = prediction.intrinsics[:, :1, None, None] / 40
    wrong = torch.cat((1.5 / to_px + nothing[:, :1], nothing[:, :1]), dim=1)  # 1.5 px, which counts 1.5 / (1 + 1.5 / 3)
    said = prediction._replace(seen=wrong)
    cost = terms(said, here, torch.ones(2, 1, 1, 1), Recipe(weights={"seen": 1.0}))["seen"]
    at = {"far": (14, 30), "two off": (2, 5), "near": (2, 3), "beside": (3, 4), "mover": (11, 19), "both": (9, 15)}
    found = {place: cost[0, 0, row, column].item() for place, (row, column) in at.items()}
    assert found == pytest.approx({"far": 0.2, "two off": 0.2, "near": 1.2, "beside": 1.2, "mover": 0.6, "both": 3.6})


def test_flow_is_compared_besides_the_one_that_was_taken_out(batch):
    """The error of a slow mover counts in full, however fast the camera: compression is of what is left."""
    recipe = Recipe(weights={"seen": 1.0})
    prediction, here, mean = true_answer(batch, 2)
    fast = torch.full_like(prediction.taken, 50.0)
    slow_error = prediction._replace(seen=prediction.seen + 0.5)
    moved = slow_error._replace(seen=slow_error.seen + fast, taken=fast)
    costs = [
        terms(one, other, mean, recipe)["seen"]
        for one, other in ((slow_error, here), (moved, here._replace(flow=here.flow + fast)))
    ]
    torch.testing.assert_close(*costs, atol=1e-3, rtol=1e-3)
    assert costs[0].max() > 0.1


def test_truth_at_a_scale_is_one_pixel_of_each_and_events_are_averages(batch):
    _, here, _ = true_answer(batch, 8)
    assert here.depth.shape == (2, 1, 4, 8)
    assert torch.equal(here.depth[..., 1, 2], batch.depth[..., 6, 10])
    assert torch.equal(here.moving[..., 2, 5], batch.moving[..., 10, 22])
    torch.testing.assert_close(here.voxels.mean((-2, -1)), batch.voxels.expm1().mean((-2, -1)))


def test_padding_is_not_valid_and_not_known(recording, tiny):
    world = recording(size=(36, 60))
    batch = whole_batch(world, [2], [true_motion(world, 2)], 32)
    here = at_scale(batch, empty_answer(batch, 2))
    assert here.valid[..., :18, :30].all()
    assert not here.valid[..., 18:, :].any() and not here.depth_valid[..., 18:, :].any()
    assert not here.valid[..., 30:].any()


def test_what_was_taken_out_is_the_flow_of_the_batchs_own_motion(batch):
    """The known wall flows by 1 px of the rectified image per slice, its truth says."""
    blank = torch.zeros(2, 1, 8, 16)
    first = FirstAnswer(blank + 1, torch.ones(2, 6), torch.ones(2, 2, 8, 16), blank, blank + 1)
    taken = taken_out(batch, first)
    wall = ~at_scale(batch, empty_answer(batch, 4)).moving[:, 0]
    wall[:, 2:6] = False
    torch.testing.assert_close(taken.rigid[:, 0][wall], torch.ones(int(wall.sum())), atol=2e-3, rtol=0)
    assert taken.rigid[:, 1].abs().max() < 1e-6
    assert torch.equal(taken.seen, first.flow)
    assert torch.equal(taken.ego, batch.taken_ego) and torch.equal(taken.rel_depth, batch.taken_depth)


@pytest.mark.parametrize("count", [1, 3, 4])
def test_each_direction_has_its_own_channel(count):
    angle = torch.arange(count) * (2 * pi / count)
    velocity = torch.stack((angle.cos(), angle.sin(), torch.zeros(count)))[None, :, None]
    share = directions(velocity, count)[0, :, 0]
    torch.testing.assert_close(share.sum(0), torch.ones(count))
    assert share.argmax(0).tolist() == list(range(count))


def test_frames_of_voxels_are_counts_and_mean_times():
    counts = torch.zeros(1, 30, 2, 2)
    counts[0, 6 + 0, 0, 1], counts[0, 6 + 5, 0, 1] = 3, 1  # slice 1: three positive in bin 0, a negative one in bin 2
    frames = slice_frames(counts)
    assert frames.shape == (1, 5, 3, 2, 2)
    assert frames[0, 1, :, 0, 1].tolist() == pytest.approx([3, 1, (3 * 1 / 6 + 5 / 6) / 4])
    assert frames.count_nonzero() == 3


@pytest.mark.parametrize("name", RECIPES)
def test_every_parameter_is_reached(name, samples, tiny, small_crops):
    """Also by the paper's losses: flow and twist are supervised by warping, through the fits of both passes."""
    model = tiny().train()
    batch = drawn_batch(samples, 2, np.random.default_rng(3), events=True)
    loss, said = objective(model, batch, RECIPES[name])
    loss.backward()
    unreached = [key for key, value in model.named_parameters() if value.grad is None or not value.grad.any()]
    assert unreached == []
    assert all(torch.isfinite(value.grad).all() for value in model.parameters())
    assert said.keys() == RECIPES[name].weights.keys() | {f"first_{term}" for term in RECIPES[name].first}


def test_the_total_is_the_weighted_sum(batch, tiny):
    recipe = RECIPES["shipped"]
    with torch.no_grad():
        loss, said = objective(tiny(), batch, recipe)
    weights = recipe.weights | {f"first_{name}": weight for name, weight in recipe.first.items()}
    assert loss.item() == pytest.approx(sum(weights[name] * value for name, value in said.items()), rel=1e-5)


def test_the_fine_warp_wants_events(batch, tiny):
    with pytest.raises(BadInput, match="events"):
        objective(tiny(), batch, RECIPES["paper"])


@pytest.mark.slow
def test_one_batch_overfits(batch, tiny):
    model, recipe = tiny(), RECIPES["shipped"]
    optimizer = torch.optim.Adam(model.parameters(), lr=1e-2, betas=(0.9, 0.99))

    def overlap():
        with torch.no_grad():
            first = model.first(batch.voxels, batch.fits, batch.valid, batch.intrinsics, batch.rotation)
            taken = taken_out(batch, first)
            told = model.second(
                batch.sharp_voxels, batch.sharp_fits, batch.valid, taken, batch.intrinsics, batch.rotation
            )[-1].mixture[:, :1]
        called = told < 0.5
        return (called & batch.moving).sum() / (called | batch.moving).sum()

    before, first = overlap(), None
    for _ in range(60):
        loss, _ = objective(model, batch, recipe)
        first = loss.item() if first is None else first
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        optimizer.step()
    assert loss.item() < 0.7 * first
    assert overlap() > max(0.6, before + 0.2)
