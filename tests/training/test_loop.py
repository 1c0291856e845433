from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from evimo.errors import BadFile, BadInput
from evimo.model.checkpoint import load_model, load_tensors
from evimo.training import loop as module
from evimo.training.config import TrainConfig
from evimo.training.data import samples_of
from evimo.training.loop import MODEL, STATE, Trainer

CONFIG = TrainConfig(steps=6, batch=2, warm_up=2, save_every=4)


class Stopped(Exception):
    """As by Ctrl-C."""


def trained(trainer, *, stop_after=None):
    """Runs a trainer and returns the steps it reported."""
    steps = []

    def report(step, terms):
        steps.append((step, terms["loss"]))
        if step == stop_after:
            raise Stopped

    if stop_after is None:
        trainer.run(report)
    else:
        with pytest.raises(Stopped):
            trainer.run(report)
    return steps


@pytest.fixture
def small(recording, small_crops):
    return samples_of([recording(slices=4)])


def test_a_stopped_run_goes_on_exactly(small, tiny, tmp_path):
    at_once = trained(Trainer(tiny(), CONFIG, small, tmp_path / "once"))
    first = trained(Trainer(tiny(), CONFIG, small, tmp_path / "twice"), stop_after=3)
    again = Trainer(tiny(7), CONFIG, small, tmp_path / "twice")  # other first weights: the checkpoint's count
    assert again.resume()
    assert again.samples_seen == 6
    assert first + trained(again) == at_once
    for name in (MODEL, STATE):
        (ours, facts), (theirs, their_facts) = (load_tensors(tmp_path / run / name) for run in ("once", "twice"))
        assert facts == their_facts
        assert ours.keys() == theirs.keys()
        assert all(torch.equal(ours[key], theirs[key]) for key in ours)


def test_what_it_leaves_is_the_averaged_model(small, tiny, tmp_path):
    trainer = Trainer(tiny(), CONFIG, small, tmp_path)
    trained(trainer)
    saved = load_model(tmp_path / MODEL).state_dict()
    state, facts = load_tensors(tmp_path / STATE)
    assert facts["step"] == 6 and facts["samples"] == 12
    assert all(torch.equal(saved[name], state[f"average.{name}"]) for name in saved)
    assert any(not torch.equal(saved[name], state[f"model.{name}"]) for name in saved)
    assert sorted(path.name for path in tmp_path.iterdir()) == [MODEL, STATE]


@pytest.mark.parametrize("change", [{"steps": 7}, {"batch": 1}, {"recipe": "paper"}, {"learning_rate": 0.1}])
def test_a_folder_holds_one_run(change, small, tiny, tmp_path):
    trained(Trainer(tiny(), CONFIG, small, tmp_path), stop_after=1)
    with pytest.raises(BadInput, match=next(iter(change))):
        Trainer(tiny(), replace(CONFIG, **change), small, tmp_path).resume()


def test_nothing_to_go_on_from(small, tiny, tmp_path):
    assert not Trainer(tiny(), CONFIG, small, tmp_path / "new").resume()


def test_a_damaged_checkpoint_is_said_to_be(small, tiny, tmp_path):
    (tmp_path / STATE).write_bytes(b"no tensors")
    with pytest.raises(BadFile):
        Trainer(tiny(), CONFIG, small, tmp_path).resume()


def test_an_unknown_recipe(small, tiny, tmp_path):
    with pytest.raises(BadInput, match="shipped"):
        Trainer(tiny(), replace(CONFIG, recipe="soup"), small, tmp_path)


def test_one_sick_sample_does_not_spoil_the_run(recording, small_crops, tiny, tmp_path):
    sick = replace(recording(slices=4), ego=np.full((4, 6), np.nan, np.float32))
    trainer = Trainer(tiny(), replace(CONFIG, steps=1), samples_of([sick]), tmp_path)
    before = {name: value.clone() for name, value in trainer.model.state_dict().items()}
    trained(trainer)
    assert all(torch.equal(before[name], value) for name, value in trainer.model.state_dict().items())


@pytest.fixture
def bare(monkeypatch, small, tiny, tmp_path):
    """Trains without batches or losses, and returns what `note(trainer, batch)` says at each step."""

    def run(config, note):
        trainer = Trainer(tiny(), config, small, tmp_path)
        noted = []

        def objective(model, batch, recipe):
            noted.append(note(trainer, batch))
            return sum(0 * value.sum() for value in model.parameters()), {}

        monkeypatch.setattr(module, "objective", objective)
        trained(trainer)
        return noted

    return run


def test_batches_drawn_ahead_are_those_of_their_steps(bare, small):
    """By the seed and the step alone, whatever is drawn when."""
    noted = bare(CONFIG, lambda trainer, batch: (trainer.step, batch))
    assert [step for step, _ in noted] == list(range(6))
    for step, batch in noted[::-1]:
        again = module.drawn_batch(small, 2, np.random.default_rng((CONFIG.seed, step)))
        assert all(torch.equal(one, other) for one, other in zip(batch[:15], again[:15], strict=True))


@pytest.mark.parametrize(("recipe", "wanted"), [("shipped", False), ("paper", True)])
def test_events_come_along_where_a_loss_wants_them(bare, recipe, wanted):
    noted = bare(replace(CONFIG, recipe=recipe, steps=1), lambda trainer, batch: batch.events is not None)
    assert noted == [wanted]


def test_the_learning_rate_rises_then_falls_by_half_a_cosine_to_a_hundredth(bare, monkeypatch):
    still = SimpleNamespace(to=lambda device: still)
    monkeypatch.setattr(module, "drawn_batch", lambda *_, **__: still)
    config = replace(CONFIG, steps=400, warm_up=10, learning_rate=0.002, save_every=1000)
    noted = bare(config, lambda trainer, batch: trainer.optimizer.param_groups[0]["lr"] / 0.002)
    assert noted[:10] == pytest.approx([k / 10 for k in range(1, 11)], rel=2e-3)  # the cosine is flat there
    assert max(noted) == pytest.approx(1, abs=2e-3) and noted.index(max(noted)) == 9
    assert noted[9:] == sorted(noted[9:], reverse=True)
    assert noted[200] == pytest.approx((1 + 0.01) / 2)  # half way
    third = 400 // 3  # where a cosine is 1/2
    assert noted[third] == pytest.approx(0.01 + 0.99 * 0.75, abs=3e-3)
    assert noted[-1] == pytest.approx(0.01, abs=1e-4)
