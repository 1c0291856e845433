import time
from concurrent.futures import Future
from dataclasses import replace

import numpy as np
import pytest
import torch

from evimo.errors import BadFile, BadInput, EvimoWarning
from evimo.model.checkpoint import load_model, load_tensors, save_tensors
from evimo.training import learner, loop
from evimo.training.config import TrainConfig
from evimo.training.data import drawn_row, samples_of, stacked
from evimo.training.loop import MODEL, STATE, Trainer
from evimo.training.recipes import RECIPES
from evimo.training.sources import from_folders

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
    return from_folders(samples_of([recording(slices=4)]))


@pytest.mark.parametrize("bfloat16", [True, False])
def test_a_stopped_run_goes_on_exactly(bfloat16, small, tiny, tmp_path):
    config = replace(CONFIG, bfloat16=bfloat16)
    at_once = trained(Trainer(tiny(), config, small, tmp_path / "once"))
    first = trained(Trainer(tiny(), config, small, tmp_path / "twice"), stop_after=3)
    again = Trainer(tiny(7), config, small, tmp_path / "twice")  # other first weights: the checkpoint's count
    assert again.resume()
    assert again.samples_seen == 6
    assert first + trained(again) == at_once
    for name in (MODEL, STATE):
        (ours, facts), (theirs, their_facts) = (load_tensors(tmp_path / run / name) for run in ("once", "twice"))
        assert facts == their_facts
        assert ours.keys() == theirs.keys()
        assert all(torch.equal(ours[key], theirs[key]) for key in ours)


def test_an_interrupt_while_weights_change_leaves_the_last_checkpoint(small, tiny, tmp_path, monkeypatch):
    trainer = Trainer(tiny(), replace(CONFIG, save_every=2), small, tmp_path)

    def stopped(*_):
        if trainer.step == 3:
            raise Stopped
        return usual()

    usual = trainer.learner.optimizer.step
    monkeypatch.setattr(trainer.learner.optimizer, "step", stopped)
    with pytest.raises(Stopped):
        trainer.run(lambda *_: None)
    assert load_tensors(tmp_path / STATE)[1]["step"] == 2


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


@pytest.fixture
def begun(small, tiny, tmp_path):
    """Makes trainers of one folder, in which a run has begun."""

    def trainer(**changes):
        return Trainer(tiny(), CONFIG, small, tmp_path, data={"recordings": "these"} | changes)

    trained(trainer(), stop_after=1)
    return trainer


def test_other_recordings_are_another_run(begun):
    assert begun().resume()
    with pytest.raises(BadInput, match="differs in recordings") as raised:
        begun(recordings="those").resume()
    assert "--preset" in raised.value.fix


def test_a_recipe_with_other_weights_is_another_run_whatever_its_name(begun, monkeypatch):
    shipped = RECIPES["shipped"]
    monkeypatch.setitem(RECIPES, "shipped", replace(shipped, weights=shipped.weights | {"mask": 0.5}))
    with pytest.raises(BadInput, match="differs in weights"):
        begun().resume()


def test_a_run_of_a_version_that_told_neither_is_refused(begun, tmp_path):
    """It also drew other samples."""
    tensors, facts = load_tensors(tmp_path / STATE)
    save_tensors(tensors, tmp_path / STATE, **{k: v for k, v in facts.items() if k not in ("weights", "data")})
    with pytest.raises(BadInput, match="older version"):
        begun().resume()


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
    trainer = Trainer(tiny(), replace(CONFIG, steps=1), from_folders(samples_of([sick])), tmp_path)
    before = {name: value.clone() for name, value in trainer.learner.model.state_dict().items()}
    ((_, loss),) = trained(trainer)
    assert np.isnan(loss)
    assert all(torch.equal(before[name], value) for name, value in trainer.learner.model.state_dict().items())


class AtOnce:
    """An executor that does what it is asked in the caller's own thread."""

    def __init__(self, workers):
        assert workers >= 1

    def submit(self, call, *arguments):
        future = Future()
        future.set_result(call(*arguments))
        return future

    def map(self, call, *columns):
        return list(map(call, *columns))

    def shutdown(self, *, wait, cancel_futures):
        """Nothing is under way."""


def test_a_run_that_learns_nothing_ends(recording, small_crops, tiny, tmp_path, monkeypatch):
    monkeypatch.setattr(loop, "SICK_STEPS", 2)
    sick = replace(recording(slices=4), ego=np.full((4, 6), np.nan, np.float32))
    trainer = Trainer(tiny(), replace(CONFIG, steps=9), from_folders(samples_of([sick])), tmp_path)
    with pytest.raises(BadInput, match=r"no number .*twist"):
        trainer.run(lambda step, terms: None)
    assert trainer.step == 2


def test_drawing_beside_the_learning_changes_nothing(small, tiny, tmp_path, monkeypatch):
    beside = trained(Trainer(tiny(), CONFIG, small, tmp_path / "beside"))
    monkeypatch.setattr(loop, "ThreadPoolExecutor", AtOnce)
    assert trained(Trainer(tiny(), CONFIG, small, tmp_path / "alone")) == beside


def test_its_pace_is_told(small, tiny, tmp_path):
    trainer = Trainer(tiny(), replace(CONFIG, steps=3), small, tmp_path)
    begun_s = time.perf_counter()
    trained(trainer)
    assert trainer.pace.samples_per_s > 2 * 2 / (time.perf_counter() - begun_s)  # without the first step, which is slow
    assert 0 <= trainer.pace.waited < 1


def test_what_a_graph_cannot_hold_is_learned_without_one(small, tiny, tmp_path, monkeypatch):
    def refused(*_):
        raise RuntimeError("not permitted")

    trainer = Trainer(tiny(), CONFIG, small, tmp_path)
    eager, batch = trainer.learner._eager_pass, stacked([drawn_row(small(0, [0])[0][0], np.random.default_rng(0))])
    monkeypatch.setattr(learner, "captured", refused)
    monkeypatch.setattr(trainer.learner, "device", torch.device("cuda"))
    with pytest.warns(EvimoWarning, match="not permitted"):
        assert trainer.learner._fastest_pass(batch) == eager
    monkeypatch.setattr(learner, "captured", lambda step, batch: (step, batch))
    assert trainer.learner._fastest_pass(batch) == (eager, batch)
    assert trainer.learner.replays_graph


def test_batches_differ_by_seed_and_step(small, tiny, tmp_path):
    losses = [
        loss
        for seed in (0, 1)
        for _, loss in trained(
            Trainer(tiny(), replace(CONFIG, seed=seed, learning_rate=1e-30, steps=2), small, tmp_path / str(seed))
        )
    ]
    assert len(set(losses)) == 4


@pytest.fixture
def rates(small, tiny, tmp_path, monkeypatch):
    """Learning rates, as shares of the highest, of the steps of a run that learns next to nothing."""

    def of_run(begin=0, **config):
        monkeypatch.setattr(learner, "objective", lambda model, *_: (next(model.parameters()).sum(), {}))
        config = TrainConfig(batch=1, learning_rate=0.01, bfloat16=False, save_every=10**9, **config)
        trainer = Trainer(tiny(), config, small, tmp_path)
        trainer.step = begin
        found = []
        trainer.run(lambda *_: found.append(trainer.learner.optimizer.param_groups[0]["lr"] / 0.01))
        return found

    return of_run


def test_the_learning_rate_falls_by_half_a_cosine(rates):
    """From 1 to 1 %: three quarters of the way down at the cosine's -1/2, half at 0, a quarter at 1/2."""
    found = rates(steps=12, warm_up=1)
    assert [found[k] for k in (0, 4, 6, 8)] == pytest.approx([1, 0.7525, 0.505, 0.2575])
    assert (np.diff(found) < 0).all()


def test_the_learning_rate_rises_evenly_at_first(rates):
    falling, rising = rates(steps=10, warm_up=1), rates(steps=10, warm_up=4)
    assert np.divide(rising, falling).tolist() == pytest.approx([0.25, 0.5, 0.75] + [1] * 7)


def test_the_last_step_learns_at_one_percent(rates):
    assert rates(steps=2000, warm_up=100, begin=1999) == pytest.approx([0.01], rel=1e-3)
