"""The mean of checkpoints, as `small` and `base` are: made by bench/average.py."""

import importlib
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from evimo.errors import BadInput
from evimo.model.checkpoint import load_model, load_tensors, save_model
from evimo.model.motion_net import MotionNet
from evimo.model.networks import network_of
from evimo.model.presets import PRESETS
from evimo.model.weights import packaged

BENCH = Path(__file__).parents[1] / "bench"
TINY = PRESETS["tiny"]


@pytest.fixture
def average(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCH))
    return importlib.import_module("average")


@pytest.fixture
def checkpoints(tmp_path):
    """Two models of one shape whose weights are 1 and 4 everywhere."""

    def saved(value, step):
        model = MotionNet(TINY)
        for weights in model.parameters():
            torch.nn.init.constant_(weights, value)
        save_model(model, tmp_path / f"{step}.safetensors", step=step, samples=8 * step)
        return tmp_path / f"{step}.safetensors"

    return [saved(1.0, 4000), saved(4.0, 4500)]


def test_the_mean_of_weights(average, checkpoints):
    mean = average.mean_of([checkpoints[0], *checkpoints])
    assert mean.config == TINY
    assert all((weights == 2).all() for weights in mean.parameters())


def test_a_checkpoint_alone_is_its_own_mean(average):
    path = packaged("tiny", ".safetensors")
    ours, theirs = average.mean_of([path]).state_dict(), load_model("tiny").state_dict()
    assert all(torch.equal(ours[name], theirs[name]) for name in theirs)


def test_other_shapes_are_refused(average, checkpoints, tmp_path):
    other = tmp_path / "other.safetensors"
    save_model(network_of(replace(TINY, hidden=8)), other)
    with pytest.raises(BadInput, match=r"other\.safetensors"):
        average.mean_of([*checkpoints, other])


def test_it_leaves_a_model_that_runs_and_knows_what_it_was_made_of(average, checkpoints, tmp_path, monkeypatch):
    out = tmp_path / "mean"
    monkeypatch.setattr(average, "export", lambda model, path: path.write_bytes(b"tested elsewhere"))
    monkeypatch.setattr("sys.argv", ["average.py", *map(str, checkpoints), "--out", str(out)])
    average.main()
    assert [each["step"] for each in load_tensors(out / "model.safetensors")[1]["mean_of"]] == [4000, 4500]
    assert (next(load_model(out / "model.safetensors").parameters()) == 2.5).all()
    assert sorted(path.name for path in out.iterdir()) == ["model.onnx", "model.safetensors"]
