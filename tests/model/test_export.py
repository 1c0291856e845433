import json
import subprocess
import sys

import numpy as np
import onnxruntime
import pytest
import torch
from evimo.streaming.evidence import EvidenceMaker, halved_mask

from evimo.model.checkpoint import save_model
from evimo.model.export import INPUTS, OUTPUTS
from evimo.model.presets import ModelConfig

EXPORT = """
import sys
from pathlib import Path
from evimo.model.checkpoint import load_model
from evimo.model.export import export
export(load_model(sys.argv[1]), Path(sys.argv[2]))
"""
WITHOUT_TORCH = """
import sys
for name in ("torch", "onnx", "safetensors", "jaxtyping"):
    sys.modules[name] = None
import numpy as np, onnxruntime
session = onnxruntime.InferenceSession(sys.argv[1], providers=["CPUExecutionProvider"])
inputs = {"image": np.zeros((1, 15, 27, 36), "f4"), "evidence": np.zeros((1, 22, 9, 12), "f4"),
          "valid": np.ones((1, 1, 27, 36), "f4"), "intrinsics": np.array([[50, 50, 36, 27]], "f4")}
print([list(output.shape) for output in session.run(None, inputs)])
"""


@pytest.fixture(scope="session")
def exported(tiny, tmp_path_factory):
    """The untrained model as ONNX; exported in a process of its own, where nothing checks shapes while it traces."""
    folder = tmp_path_factory.mktemp("exported")
    save_model(tiny, folder / "tiny.safetensors")
    command = [sys.executable, "-c", EXPORT, str(folder / "tiny.safetensors"), str(folder / "tiny.onnx")]
    subprocess.run(command, check=True, env={"OMP_NUM_THREADS": "1"})
    return folder / "tiny.onnx"


@pytest.fixture(scope="session")
def session(exported):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    return onnxruntime.InferenceSession(exported, options, providers=["CPUExecutionProvider"])


@pytest.mark.parametrize("gone", [[], [0, 4], [0, 1, 3, 4]])
@pytest.mark.parametrize("size", [(54, 72), (47, 61), (90, 100)])
def test_compiled_evidence_with_onnx_and_torch_are_equal(size, gone, tiny, session, stack):
    frames, valid, intrinsics = stack(size)
    frames[:, gone] = 0
    valid[..., :5, :] = 0
    maker = EvidenceMaker(size, stride=18, reduction=3)
    images = [maker.images(frame) for frame in frames[0].numpy()]
    half_valid = halved_mask(valid[0, 0].numpy() > 0, stride=18)
    inputs = (maker.image(images), maker.evidence(images), half_valid[None], intrinsics[0].numpy())
    feeds = {name: values[None] for name, values in zip(INPUTS, inputs, strict=True)}
    found = dict(zip(OUTPUTS, session.run(list(OUTPUTS), feeds), strict=True))
    with torch.no_grad():
        finest = tiny(frames, valid, intrinsics)[-1]
    expected = {
        "moving": finest.mixture[:, 1:].sum(1, keepdim=True),
        "rel_depth": finest.rel_depth,
        "velocity": finest.object_velocity,
        "flow": finest.flow,
    }
    for name, values in {**expected, "ego": finest.ego}.items():
        scale = 1 + values.abs().max().item()
        np.testing.assert_allclose(found[name], values.numpy(), atol=2e-3 * scale, rtol=0, err_msg=name)


def test_names_and_free_sizes(session):
    assert tuple(one.name for one in session.get_inputs()) == INPUTS
    assert tuple(one.name for one in session.get_outputs()) == OUTPUTS
    shapes = [one.shape for one in session.get_inputs()]
    assert shapes[:2] == [[1, 15, "height", "width"], [1, 22, "cells_high", "cells_wide"]]


def test_the_configuration_comes_along(session, tiny):
    facts = {key: json.loads(value) for key, value in session.get_modelmeta().custom_metadata_map.items()}
    assert ModelConfig(**facts["config"]) == tiny.config
    assert (facts["stride"], facts["evidence_reduction"]) == (18, 3)


def test_running_needs_onnxruntime_only(exported):
    command = [sys.executable, "-c", WITHOUT_TORCH, str(exported)]
    said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    assert json.loads(said) == [[1, 1, 27, 36], [1, 1, 27, 36], [1, 6], [1, 3, 27, 36], [1, 2, 27, 36]]


def test_nothing_unfinished_is_left(exported):
    assert {path.name for path in exported.parent.iterdir()} == {"tiny.onnx", "tiny.safetensors"}
