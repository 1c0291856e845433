import os
import pickle
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import torch

from evimo.errors import BadInput
from evimo.model.checkpoint import load_tensors
from evimo.training.config import TrainConfig
from evimo.training.data import samples_of
from evimo.training.devices import Team, joined_team, training_device
from evimo.training.loop import MODEL, STATE, Trainer
from evimo.training.sources import from_folders

PROGRAM = Path(__file__).with_name("one_of_a_team.py")


def team_of(size, *arguments, killed=False):
    """Runs the program in so many processes as torchrun does; what each printed, as (step, loss)."""
    together = {"WORLD_SIZE": str(size), "MASTER_ADDR": "127.0.0.1", "MASTER_PORT": str(29_500 + os.getpid() % 1000)}
    command = [sys.executable, str(PROGRAM), *map(str, arguments)]
    processes = [
        subprocess.Popen(command, env={**os.environ, **together, "RANK": str(rank)}, stdout=subprocess.PIPE, text=True)
        for rank in range(size)
    ]
    said = [process.communicate(timeout=200)[0] for process in processes]
    assert {process.returncode for process in processes} == {-signal.SIGKILL if killed else 0}
    return [[tuple(map(float, line.split())) for line in lines.splitlines()] for lines in said]


@pytest.mark.slow
def test_two_processes_learn_what_one_does(recording, tmp_path):
    """Three samples per batch: their shares are not even alike."""
    (tmp_path / "world.pickle").write_bytes(pickle.dumps(recording(slices=4)))
    (alone,) = team_of(1, tmp_path / "world.pickle", tmp_path / "one")
    first, second = team_of(2, tmp_path / "world.pickle", tmp_path / "two")
    assert len(alone) == 3
    assert first == second
    for (step, loss), (its_step, its_loss) in zip(alone, first, strict=True):
        assert step == its_step and loss == pytest.approx(its_loss, rel=1e-4)
    (ours, facts), (theirs, its_facts) = (load_tensors(tmp_path / run / STATE) for run in ("one", "two"))
    assert facts == its_facts
    for name in ("model", "average", "adam"):
        mine, its = (torch.cat([v.flatten() for k, v in each.items() if k.startswith(name)]) for each in (ours, theirs))
        assert (mine - its).norm() < 1e-4 * mine.norm()  # Adam lets a gradient of rounding errors move its weight


@pytest.mark.slow
def test_a_killed_run_goes_on_to_the_byte(recording, tmp_path):
    (tmp_path / "world.pickle").write_bytes(pickle.dumps(recording(slices=4)))
    (alone,) = team_of(1, tmp_path / "world.pickle", tmp_path / "one")
    (killed,) = team_of(1, tmp_path / "world.pickle", tmp_path / "two", 2, killed=True)
    (rest,) = team_of(1, tmp_path / "world.pickle", tmp_path / "two")
    assert [*killed[:1], *rest] == alone  # the second step is made again: it was reported, but not yet saved
    for name in (MODEL, STATE):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_every_sample_has_one_process():
    places = [Team(rank, 3).places(8) for rank in range(3)]
    assert sorted(place for each in places for place in each) == list(range(8))


def test_more_processes_than_samples(recording, tiny, tmp_path):
    source = from_folders(samples_of([recording()]))
    with pytest.raises(BadInput, match="3 processes"):
        Trainer(tiny(), TrainConfig(batch=2), source, tmp_path, team=Team(0, 3))


def test_without_torchrun_there_is_no_team(monkeypatch):
    monkeypatch.delenv("WORLD_SIZE", raising=False)
    with joined_team("cpu") as team:
        assert team == Team(0, 1)


def test_other_devices_are_refused():
    assert training_device("cpu") == "cpu"
    with pytest.raises(BadInput, match="no device 'tpu'"):
        training_device("tpu")
