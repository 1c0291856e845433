"""The paper's rival in training: by warping alone, with its own recipe, and scored by what it says."""

import math

import numpy as np
import pytest
import torch

from evimo.errors import BadInput
from evimo.model.checkpoint import load_model
from evimo.training.config import TrainConfig
from evimo.training.data import drawn_sample, samples_of, stacked
from evimo.training.loop import MODEL, Trainer
from evimo.training.objective import objective
from evimo.training.recipes import RECIPES
from evimo.training.sources import from_folders
from evimo.training.validation import validated

ECN = RECIPES["ecn"]
TRUTH = ("depth", "moving", "flow", "velocity", "ego")


@pytest.fixture
def batch(recording, small_crops):
    """Two samples of a wall before a camera that moves along x, with the middle slices' events."""
    world = recording(size=(64, 64), slices=7, with_box=False)
    rows = [drawn_sample(world, k, np.random.default_rng(k)) for k in (2, 3)]
    return stacked(rows, events=True)


def test_no_truth_is_asked(batch, ecn):
    """What would change with the truth is supervised by it; the other recipes are."""
    model = ecn()
    other = batch._replace(**{name: torch.full_like(getattr(batch, name), 3) for name in TRUTH})
    assert objective(model, batch, ECN)[0] == objective(model, other, ECN)[0]


def test_every_weight_learns(batch, ecn):
    model = ecn()
    loss, terms = objective(model, batch, ECN)
    loss.backward()
    assert set(terms) == set(ECN.weights)
    silent = {name for name, value in model.named_parameters() if value.grad is None or not value.grad.any()}
    assert {name for name in silent if not name.startswith("depth_net.heads")} == set()


@pytest.mark.slow
def test_warping_alone_finds_the_flow_of_a_moving_camera(batch, ecn):
    """One px per slice along x, by a known world: the answer comes nearer to it than a camera at rest is."""
    model = ecn()
    optimizer = torch.optim.Adam(model.parameters(), lr=3e-3)
    for _ in range(20):
        optimizer.zero_grad()
        objective(model, batch, ECN)[0].backward()
        optimizer.step()
    with torch.no_grad():
        said, _ = model.finest(batch.voxels, batch.valid, batch.intrinsics)
    true = batch.flow * batch.intrinsics[:, :2, None, None] / 40
    error, zero = ((flow - true).norm(dim=1).mean().item() for flow in (said.flow, 0 * said.flow))
    assert zero == pytest.approx(1, abs=0.01)
    assert error < 0.6


def test_each_recipe_trains_its_own_kind_of_network(samples, ecn, tiny, tmp_path):
    for model, recipe, instead in ((ecn(), "shipped", "ecn"), (ecn(), "paper", "ecn"), (tiny(), "ecn", "paper or")):
        with pytest.raises(BadInput, match=f"recipe '{recipe}'") as raised:
            Trainer(model, TrainConfig(recipe=recipe), from_folders(samples), tmp_path)
        assert instead in raised.value.fix


def test_a_run_leaves_what_loads_again_and_goes_on(recording, ecn, tmp_path, small_crops):
    source = from_folders(samples_of([recording()]))
    config = TrainConfig(recipe="ecn", steps=2, batch=2)
    trainer = Trainer(ecn(hidden=4, growth=2), config, source, tmp_path)
    trainer.run(lambda step, terms: None)
    loaded = load_model(tmp_path / MODEL)
    assert loaded.config == trainer.learner.model.config
    again = Trainer(ecn(1, hidden=4, growth=2), config, source, tmp_path)
    assert again.resume() and again.step == 2
    for ours, theirs in zip(again.averaged().state_dict().values(), loaded.state_dict().values(), strict=True):
        torch.testing.assert_close(ours, theirs)


def test_scores_are_of_what_it_says(recording, ecn):
    world = recording(size=(64, 64))
    scores = validated(ecn().eval(), [world])
    assert all(math.isnan(scores[name]) for name in ("iou", "event_iou", "alarms"))
    assert all(math.isfinite(scores[name]) for name in ("flow", "static_flow", "translation", "depth"))
