from dataclasses import replace

import numpy as np
import pytest
import torch

from evimo.errors import BadFile, BadInput
from evimo.model.checkpoint import load_model, load_tensors
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
def small(recording):
    return [samples_of([recording(size=(18, 36), slices=4)])]


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


def test_one_sick_sample_does_not_spoil_the_run(recording, tiny, tmp_path):
    sick = replace(recording(size=(18, 36), slices=4), ego=np.full((4, 6), np.nan, np.float32))
    trainer = Trainer(tiny(), replace(CONFIG, steps=1), [samples_of([sick])], tmp_path)
    before = {name: value.clone() for name, value in trainer.model.state_dict().items()}
    trained(trainer)
    assert all(torch.equal(before[name], value) for name, value in trainer.model.state_dict().items())


def test_recordings_of_several_sizes_are_drawn_by_their_number_of_samples(recording, tiny, tmp_path):
    groups = [samples_of([recording(size=(18, 36), slices=1)]), samples_of([recording(size=(36, 18), slices=9)])]
    trainer = Trainer(tiny(), CONFIG, groups, tmp_path)
    wide = 0
    for trainer.step in range(100):
        wide += trainer._batch().valid.shape[-1] == 36
    assert 2 <= wide <= 25
