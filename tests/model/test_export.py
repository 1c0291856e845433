import json
import os
import subprocess
import sys

import numpy as np
import onnx
import onnx.parser
import onnxruntime
import pytest
import torch

from evimo.events.events import Events
from evimo.events.local_motion import motion_candidates
from evimo.events.slices import SLICE_US, Slice
from evimo.events.stack import StaticMotion
from evimo.geometry.camera import Camera
from evimo.geometry.rectification import rectified
from evimo.model.checkpoint import save_model
from evimo.model.export import FIRST_INPUTS, FIRST_OUTPUTS, SECOND_INPUTS, SECOND_OUTPUTS, shortened
from evimo.model.presets import ModelConfig
from evimo.model.second_pass import compensation
from evimo.recordings.prepared import SUBPIXEL, Prepared
from evimo.streaming import inference
from evimo.streaming.looks import Looks, Placed, stacked
from evimo.streaming.rotation import UNKNOWN
from evimo.training.data import DEPTH_STEP, whole_batch

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
import numpy as np
from evimo.streaming.inference import Network, Seen
network = Network(sys.argv[1])
lens = np.array((50, 50, 48, 32), "f4"), np.zeros(4, "f4")
fits, valid = np.zeros((24, 32, 48), "f4"), np.ones((32, 48), "f4")
motion = network.first(Seen(np.zeros((30, 32, 48), "f4"), fits, valid, *lens), np.zeros((22, 16, 24), "f4"))
answer = network.second(Seen(np.zeros((30, 64, 96), "f4"), fits, valid, *lens), motion)
print([list(output.shape) for output in (*motion, *answer)])
"""
HALF_PRECISION = 2e-3  # weights keep eleven bits; what they say differs by about as much, against its largest value


@pytest.fixture(scope="session")
def exported(tiny, tmp_path_factory):
    """The untrained model as ONNX; exported in a process of its own, where nothing checks shapes while it traces."""
    folder = tmp_path_factory.mktemp("exported")
    save_model(tiny, folder / "tiny.safetensors")
    command = [sys.executable, "-c", EXPORT, str(folder / "tiny.safetensors"), str(folder / "tiny.onnx")]
    subprocess.run(command, check=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
    return folder / "tiny.onnx"


@pytest.fixture(scope="session", params=["tiny.onnx", "tiny.first.onnx"])
def each(exported, request):
    """Path of either file, then the names of its inputs and outputs."""
    first = "first" in request.param
    names = (FIRST_INPUTS, FIRST_OUTPUTS) if first else (SECOND_INPUTS, SECOND_OUTPUTS)
    return exported.with_name(request.param), *names


@pytest.fixture(scope="session")
def network(exported):
    return inference.Network(exported, workers=1)


def assert_close(found, expected, name):
    expected = expected.numpy()[0] if torch.is_tensor(expected) else expected
    scale = 1 + np.abs(expected).max()
    np.testing.assert_allclose(np.squeeze(found), np.squeeze(expected), atol=HALF_PRECISION * scale, err_msg=name)


@pytest.mark.parametrize("rotation", [(0, 0, 0, 0), (0.02, -0.01, 0.03, 1)])
@pytest.mark.parametrize("size", [(32, 64), (96, 64)])
def test_both_passes_are_equal_in_onnx_and_torch(size, rotation, tiny, network, look):
    seen = look(size)._replace(rotation=torch.tensor([rotation], dtype=torch.float32))
    seen.valid[..., :5, :] = 0
    feeds = [image[0].numpy() for image in (seen.voxels, seen.fits, seen.valid[0], seen.intrinsics, seen.rotation)]
    found = network.first(inference.Seen(*feeds), seen.candidates[0].numpy())
    with torch.no_grad():
        first, finest = seen.first(tiny), seen.second(tiny)[-1]
    for name in FIRST_OUTPUTS:
        assert_close(getattr(found, name), getattr(first, name), name)
    feeds[0] = seen.sharp_voxels[0].numpy()
    answer = network.second(inference.Seen(*feeds), found)
    expected = finest._asdict() | {
        "moving": finest.mixture[:, 1:].sum(1, keepdim=True),
        "velocity": finest.object_velocity,
        "flow": finest.flow,
    }
    for name in SECOND_OUTPUTS:
        assert_close(getattr(answer, name), expected[name], name)


def events_of(size, slices, *, per_slice=400):
    """Random events of some slices, sorted by time, from time 0."""
    rng = np.random.default_rng(0)
    t = np.sort(rng.integers(0, slices * SLICE_US, slices * per_slice))
    x, y = (rng.integers(0, side, len(t)).astype(np.uint16) for side in size[::-1])
    return Events(x, y, t, rng.choice(np.array((-1, 1), np.int8), len(t)))


def prepared_of(events, size, slices, intrinsics):
    """The same events as a prepared recording seen through a pinhole; its truth is nothing."""
    nothing = np.zeros((slices, *size))
    return Prepared(
        intrinsics=intrinsics,
        valid=np.ones(size, bool),
        depth=nothing.astype(np.float16),
        ids=nothing.astype(np.uint8),
        moving=nothing > 0,
        clutter=nothing > 0,
        flow=np.stack((nothing, nothing), axis=1).astype(np.float16),
        velocity=np.zeros((slices, 256, 3), np.float32),
        ego=np.zeros((slices, 6), np.float32),
        event_xy=(np.stack((events.x, events.y), axis=1) * SUBPIXEL).astype(np.uint16),
        event_t=(events.t % SLICE_US).astype(np.uint16),
        event_on=events.p > 0,
        event_first=np.searchsorted(events.t, np.arange(slices + 1) * SLICE_US),
    )


@pytest.mark.parametrize("middle", [4, 1])
@pytest.mark.parametrize("size", [(64, 96), (46, 62), (45, 61)])
def test_what_a_run_says_is_what_training_sees(size, middle, tiny, network):
    """From events to answers: the compiled path with ONNX, and batches of training with torch."""
    slices = 9
    camera = Camera(60.0, 62.0, 0.45 * size[1], 0.55 * size[0], *size)
    events = events_of(size, slices)
    rectification = rectified(camera)
    placed, looks = Placed(rectification), Looks(rectification, stride=network.stride)
    parts = [
        placed.slice(Slice(k, k * SLICE_US, (k + 1) * SLICE_US, events.between(k * SLICE_US, (k + 1) * SLICE_US)))
        for k in range(slices)
    ]
    around = [[parts[m] if 0 <= m < slices else None for m in range(k - 2, k + 3)] for k in range(slices)]
    wanted = [min(max(k, 0), slices - 1) for k in range(middle - 2, middle + 3)]
    motions = {}
    for k in set(wanted):
        look = looks.first(stacked(around[k]), UNKNOWN)
        motions[k] = network.first(look, motion_candidates(look.voxels))
    stack = stacked(around[middle])
    found = looks.static_motion([motions[k] for k in wanted])
    answer = network.second(looks.second(stack, found, UNKNOWN), motions[middle])

    image = rectification.image
    lens = np.array((image.fx, image.fy, image.cx, image.cy), np.float32)
    recording = prepared_of(events, size, slices, lens)
    still = StaticMotion(np.zeros((5, 6), np.float32), np.ones((1, 1), np.float32), 1024, lens)
    with torch.no_grad():
        firsts = {}
        for k in set(wanted):
            batch = whole_batch(recording, [k], [still], tiny.config.stride)
            firsts[k] = tiny.first(
                batch.voxels, batch.fits, batch.candidates, batch.valid, batch.intrinsics, batch.rotation
            )
        own = firsts[middle]
        twist = torch.cat([firsts[k].ego for k in wanted]).numpy()
        motion = StaticMotion(twist, (1 / own.rel_depth)[0, 0].numpy(), DEPTH_STEP, lens)
        batch = whole_batch(recording, [middle], [motion], tiny.config.stride)
        taken = compensation(batch.taken_ego, batch.taken_depth, own.flow, batch.intrinsics)
        finest = tiny.second(
            batch.sharp_voxels, batch.sharp_fits, batch.valid, taken, batch.intrinsics, batch.rotation
        )[-1]
    for name in FIRST_OUTPUTS:
        assert_close(getattr(motions[middle], name), getattr(own, name), name)
    torch.testing.assert_close(batch.taken_depth, own.rel_depth)
    expected = finest._asdict() | {"moving": 1 - finest.mixture[:, :1], "velocity": finest.object_velocity}
    for name in ("moving", "rel_depth", "ego", "velocity"):
        assert_close(getattr(answer, name), expected[name], name)
    assert_close(answer.flow, finest.flow, "flow")


def test_names_and_free_sizes(each):
    path, inputs, outputs = each
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    assert tuple(one.name for one in session.get_inputs()) == inputs
    assert tuple(one.name for one in session.get_outputs()) == outputs
    shapes = {one.name: one.shape for one in session.get_inputs()}
    assert shapes["voxels"] == [1, 30, "voxels height", "voxels width"]
    assert shapes["fits"] == [1, 24, "fits height", "fits width"]
    assert (shapes["intrinsics"], shapes["rotation"]) == ([1, 4], [1, 4])


def test_the_configuration_comes_along(each, tiny):
    session = onnxruntime.InferenceSession(each[0], providers=["CPUExecutionProvider"])
    facts = {key: json.loads(value) for key, value in session.get_modelmeta().custom_metadata_map.items()}
    assert ModelConfig(**facts["config"]) == tiny.config
    assert facts["stride"] == tiny.config.stride == 32


def test_large_weights_are_stored_in_half_precision(each):
    stored = onnx.load(each[0]).graph.initializer
    elements = {kind: [int(np.prod(t.dims)) for t in stored if t.data_type == kind] for kind in (1, 10)}
    assert max(elements[1]) < 1024 <= min(elements[10])


def test_running_needs_onnxruntime_only(exported):
    command = [sys.executable, "-c", WITHOUT_TORCH, str(exported)]
    said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    first = [[16, 24], [6], [2, 16, 24]]
    assert json.loads(said) == [*first, [32, 48], [32, 48], [6], [3, 32, 48], [2, 32, 48], [32, 48]]


def test_nothing_unfinished_is_left(exported):
    names = {path.name for path in exported.parent.iterdir()}
    assert names == {"tiny.onnx", "tiny.first.onnx", "tiny.safetensors"}


def test_running_and_export_name_things_alike():
    for name in ("FIRST_INPUTS", "FIRST_OUTPUTS", "SECOND_INPUTS", "SECOND_OUTPUTS"):
        assert getattr(inference, name) == globals()[name]


def test_names_inside_are_numbers(each):
    """Half of a small model's file would be names of nodes and tensors."""
    graph = onnx.load(each[0]).graph
    outside = {value.name for value in (*graph.input, *graph.output)}
    inside = {name for node in graph.node for name in (*node.input, *node.output)} - outside - {""}
    assert inside and all(name.isdigit() for name in inside)
    assert {tensor.name for tensor in graph.initializer} <= inside
    assert not any(node.name for node in graph.node)


def test_a_graph_inside_a_node_is_refused():
    """Its names would refer to those outside, which are numbers."""
    text = """<ir_version: 10, opset_import: ["": 18]>
    branching (bool yes, float[2] x) => (float[2] y) {
      y = If (yes) <then_branch = t () => (float[2] a) { a = Neg (x) },
                    else_branch = e () => (float[2] b) { b = Abs (x) }>
    }"""
    with pytest.raises(ValueError, match="another graph"):
        shortened(onnx.parser.parse_model(text))
