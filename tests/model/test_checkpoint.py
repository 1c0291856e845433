import pickle
from dataclasses import asdict
from pathlib import Path

import pytest
import torch

from evimo.errors import BadFile, NotFound
from evimo.model.checkpoint import load_model, load_tensors, save_model, save_tensors
from evimo.model.ecn import Ecn
from evimo.model.presets import ECN, PRESETS
from evimo.model.weights import packaged


def test_what_was_saved_is_loaded(tiny, tmp_path):
    save_model(tiny, tmp_path / "model.safetensors", step=7)
    loaded = load_model(tmp_path / "model.safetensors")
    assert loaded.config == tiny.config
    assert not loaded.training
    ours, theirs = tiny.state_dict(), loaded.state_dict()
    assert list(ours) == list(theirs)
    assert all(torch.equal(ours[name], theirs[name]) for name in ours)
    assert load_tensors(tmp_path / "model.safetensors")[1] == {"config": asdict(tiny.config), "step": 7}
    assert [path.name for path in tmp_path.iterdir()] == ["model.safetensors"]


@pytest.mark.parametrize("kept", [0, 5, 1000, -1])
def test_a_damaged_file_is_said_to_be(kept, tiny, tmp_path):
    path = tmp_path / "model.safetensors"
    save_model(tiny, path)
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(BadFile, match="evimo train"):
        load_model(path)


class Harm:
    """Writes a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self):
        return Path.touch, (self.path,)


@pytest.mark.parametrize("by_torch", [False, True])
def test_a_pickle_is_refused_and_never_run(by_torch, tmp_path):
    path = tmp_path / "model.safetensors"
    if by_torch:
        torch.save(Harm(tmp_path / "harmed"), path)
    else:
        path.write_bytes(pickle.dumps(Harm(tmp_path / "harmed")))
    with pytest.raises(BadFile):
        load_model(path)
    assert not (tmp_path / "harmed").exists()


@pytest.mark.parametrize("name", ["huge", "runs/nothing.safetensors"])
def test_an_unknown_name_lists_what_there_is(name):
    with pytest.raises(NotFound, match=r"tiny.*\.safetensors"):
        load_model(name)


@pytest.mark.parametrize("config", [{"depth": 3}, {"hidden": 16}, {"layers": 1}, {"first_growth": 9}, 3])
def test_another_kind_of_model_is_refused(config, tiny, tmp_path):
    facts = {**asdict(tiny.config), **config} if isinstance(config, dict) else config
    save_tensors(dict(tiny.state_dict()), tmp_path / "model.safetensors", config=facts)
    with pytest.raises(BadFile, match="another kind"):
        load_model(tmp_path / "model.safetensors")


def test_missing_and_additional_tensors_are_refused(tiny, tmp_path):
    state = dict(tiny.state_dict())
    first = next(iter(state))
    for changed in ({**state, "more": torch.zeros(1)}, {name: state[name] for name in state if name != first}):
        save_tensors(changed, tmp_path / "model.safetensors", config=asdict(tiny.config))
        with pytest.raises(BadFile):
            load_model(tmp_path / "model.safetensors")


@pytest.mark.parametrize("name", ["base", "small", "tiny"])
def test_packaged_weights_load_by_name(name, look):
    model = load_model(name)
    assert model.config == PRESETS[name]
    assert all(torch.isfinite(value).all() for value in look((64, 96)).second(model)[-1])


def test_the_rival_is_packaged_and_told_by_its_shape():
    model = load_model(ECN)
    assert isinstance(model, Ecn) and model.config == PRESETS[ECN]


@pytest.mark.parametrize("config", [{"hidden": 12}, {"growth": 4, "layers": 3, "hidden": 12}])
def test_a_rival_of_another_shape_is_refused(config, ecn, tmp_path):
    save_tensors(dict(ecn.state_dict()), tmp_path / "model.safetensors", config=config)
    with pytest.raises(BadFile, match="another kind"):
        load_model(tmp_path / "model.safetensors")


def test_only_files_beside_the_code_are_packaged():
    assert packaged("../checkpoint", ".py") is None
    assert packaged("__init__", ".py") is not None
