"""Weights in safetensors files that carry their configuration; never a pickle."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from evimo.arguments import path_of
from evimo.errors import BadFile, BadInput, NotFound
from evimo.model.networks import Model, config_of, network_of
from evimo.model.presets import PRESETS
from evimo.model.weights import packaged
from evimo.writing import new_file


def load_model(name_or_path: str | Path, *, device: str = "cpu") -> Model:
    """Load a trained model for PyTorch: `load_model("small")`, `load_model("runs/wall/model.safetensors")`.

    Raises:
        NotFound: no such preset or file.
        BadFile: the file is damaged, or of another kind.
        BadInput: there is no such device here.
    """
    path = packaged(str(name_or_path), ".safetensors") or path_of(name_or_path, "a model")
    if not path.is_file():
        raise NotFound(
            f"no model {str(name_or_path)!r}", fix=f"one of {', '.join(PRESETS)}, or the path of a .safetensors file"
        )
    tensors, facts = load_tensors(path)
    try:
        model = network_of(config_of(facts["config"]))
        model.load_state_dict(tensors)
    except (KeyError, TypeError, AttributeError, RuntimeError) as error:
        raise BadFile(f"{path} holds another kind of model: {error}", fix="a file that `evimo train` wrote") from error
    try:
        return model.to(device).eval()
    except (RuntimeError, AssertionError, TypeError) as error:  # of torch, each its own way to say that there is none
        why = str(error).splitlines()[0]
        raise BadInput(f"no device {device!r} for a model: {why}", fix="cpu, or a device that torch can use") from error


def save_model(model: Model, path: Path, **facts: Any) -> None:
    """Write weights and configuration, and any facts that JSON can hold."""
    save_tensors(dict(model.state_dict()), path, config=asdict(model.config), **facts)


def save_tensors(tensors: dict[str, Tensor], path: Path, **facts: Any) -> None:
    """Write tensors and facts, whole or not at all.

    Raises:
        BadInput: it cannot be written, or the disk is full.
    """
    content = save({name: tensor.contiguous() for name, tensor in tensors.items()}, {"facts": json.dumps(facts)})
    with new_file(path) as file:
        file.write_bytes(content)


def load_tensors(path: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Read what `save_tensors` wrote.

    Raises:
        BadFile: it is no such file.
    """
    try:
        with safe_open(path, framework="pt") as saved:
            facts: dict[str, Any] = json.loads((saved.metadata() or {})["facts"])
            return {name: saved.get_tensor(name) for name in saved.keys()}, facts  # noqa: SIM118 (no mapping)
    except (SafetensorError, KeyError, ValueError, OSError) as error:
        raise BadFile(
            f"{path} is not a checkpoint of this program: {error}", fix="a file that `evimo train` wrote"
        ) from error
