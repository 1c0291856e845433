"""A trained model to ONNX graphs, one for each pass: any image size, no torch to run them."""

import json
import os
import tempfile
import warnings
from dataclasses import asdict
from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import helper, numpy_helper
from torch import Tensor, nn

from evimo.events.local_motion import CANDIDATE_CHANNELS
from evimo.events.stack import FITS, VOXELS
from evimo.model.ecn import Ecn
from evimo.model.motion_net import SLICES_PER_S, MotionNet
from evimo.model.networks import Model, compute_in
from evimo.model.second_pass import compensation
from evimo.model.weights import first_pass_beside
from evimo.writing import new_file

FIRST_INPUTS = ("voxels", "fits", "candidates", "valid", "intrinsics", "rotation")
FIRST_OUTPUTS = ("rel_depth", "ego", "flow")
SECOND_INPUTS = ("voxels", "fits", "valid", "intrinsics", "rotation", "taken_ego", "taken_depth", "taken_seen")
SECOND_OUTPUTS = ("moving", "rel_depth", "ego", "velocity", "flow", "confidence")
ONLY_INPUTS = ("voxels", "valid", "intrinsics")
ONLY_OUTPUTS = ("rel_depth", "ego", "flow", "confidence")
HALVED_FROM = 1024  # elements of a weight that is stored in half precision


class First(nn.Module):
    """The first pass, inputs and outputs in the order of `FIRST_INPUTS` and `FIRST_OUTPUTS`."""

    def __init__(self, model: MotionNet) -> None:
        super().__init__()
        self.model = model

    def forward(
        self, voxels: Tensor, fits: Tensor, candidates: Tensor, valid: Tensor, intrinsics: Tensor, rotation: Tensor
    ) -> tuple[Tensor, ...]:
        """See `FirstPass.forward`; all but the twist and what is known of the lens are images."""
        return self.model.first(voxels, fits, candidates, valid, intrinsics, rotation)[:3]


class Second(nn.Module):
    """The finest scale of the answer, inputs and outputs in the order of `SECOND_INPUTS` and `SECOND_OUTPUTS`."""

    def __init__(self, model: MotionNet) -> None:
        super().__init__()
        self.model = model

    def forward(
        self,
        voxels: Tensor,
        fits: Tensor,
        valid: Tensor,
        intrinsics: Tensor,
        rotation: Tensor,
        taken_ego: Tensor,
        taken_depth: Tensor,
        taken_seen: Tensor,
    ) -> tuple[Tensor, ...]:
        """See `MotionNet.second`.

        Returns:
            moving (1, 1, h, w) probability; rel_depth (1, 1, h, w); ego (1, 6) mean depths per second and rad/s;
            velocity (1, 3, h, w) of what each pixel shows, mean depths per second; flow (1, 2, h, w) 1/s on Z = 1;
            confidence (1, 1, h, w) in the flow.
        """
        taken = compensation(taken_ego, taken_depth, taken_seen, intrinsics)
        finest = self.model.second(voxels, fits, valid, taken, intrinsics, rotation)[-1]
        moving = 1 - finest.mixture[:, :1]
        return moving, finest.rel_depth, finest.ego, finest.object_velocity, finest.flow, finest.confidence


class Only(nn.Module):
    """The network that looks once, inputs and outputs in the order of `ONLY_INPUTS` and `ONLY_OUTPUTS`."""

    def __init__(self, model: Ecn) -> None:
        super().__init__()
        self.model = model

    def forward(self, voxels: Tensor, valid: Tensor, intrinsics: Tensor) -> tuple[Tensor, ...]:
        """See `Ecn.finest`; in the units of `Second`."""
        said, confidence = self.model.finest(voxels, valid, intrinsics)
        focal_px = intrinsics[:, :2, None, None]
        return said.rel_depth, said.ego * SLICES_PER_S, said.flow / focal_px * SLICES_PER_S, confidence


def export(model: Model, path: Path) -> None:
    """Write a model as ONNX that takes images of any size: the second pass at `path`, the first pass beside it.

    Of a network that looks once, the only pass at `path`. The configuration is in the metadata of each file.
    """
    model = compute_in(model.eval(), torch.float32)
    high, wide = 2 * model.config.stride, 3 * model.config.stride
    lens = (torch.tensor([[0.75 * wide, 0.75 * wide, wide / 2, high / 2]]), torch.zeros(1, 4))

    def image(channels: int, step: int) -> Tensor:
        return torch.rand(1, channels, high // step, wide // step) + 0.1

    if isinstance(model, Ecn):
        only = (image(VOXELS, 2), image(1, 2), lens[0])
        _write(Only(model), only, (ONLY_INPUTS, ONLY_OUTPUTS), path)
        return
    first = (image(VOXELS, 2), image(FITS, 2), image(CANDIDATE_CHANNELS, 4), image(1, 2), *lens)
    taken = (torch.rand(1, 6), image(1, 4), image(2, 4))
    second = (image(VOXELS, 1), image(FITS, 2), image(1, 2), *lens, *taken)
    _write(First(model), first, (FIRST_INPUTS, FIRST_OUTPUTS), first_pass_beside(path))
    _write(Second(model), second, (SECOND_INPUTS, SECOND_OUTPUTS), path)


def _write(
    part: First | Second | Only, example: tuple[Tensor, ...], names: tuple[tuple[str, ...], ...], path: Path
) -> None:
    """Trace, fold, halve, check, write."""
    inputs, outputs = names
    free = {
        name: {2: f"{name} height", 3: f"{name} width"}
        for name in (*inputs, *outputs)
        if name not in ("intrinsics", "rotation", "taken_ego", "ego")
    }
    with warnings.catch_warnings(), torch.no_grad(), tempfile.TemporaryDirectory() as folder:
        warnings.simplefilter("ignore")  # the exporter's own, about itself
        traced = Path(folder) / "traced.onnx"
        # By tracing: the exporter of torch.export takes minutes over this graph's symbolic sizes.
        torch.onnx.export(
            part.eval(),
            example,
            str(traced),
            dynamo=False,
            opset_version=18,
            input_names=list(inputs),
            output_names=list(outputs),
            dynamic_axes=free,
        )
        proto = shortened(halved(folded(traced)))
    config = part.model.config
    for key, value in {"config": asdict(config), "stride": config.stride}.items():
        entry = proto.metadata_props.add()
        entry.key, entry.value = key, json.dumps(value)
    onnx.checker.check_model(proto)
    with new_file(path) as file:
        file.write_bytes(proto.SerializeToString())


def folded(traced: Path) -> onnx.ModelProto:
    """The graph with constants folded and dead ends cut: half as many nodes, and quick to load."""
    os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")  # as streaming.graphs
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_ENABLE_BASIC
    options.log_severity_level = 3
    options.optimized_model_filepath = str(traced.with_name("folded.onnx"))
    onnxruntime.InferenceSession(str(traced), options, providers=["CPUExecutionProvider"])
    return onnx.load(options.optimized_model_filepath)


def halved(proto: onnx.ModelProto) -> onnx.ModelProto:
    """The same graph with its large weights stored in half precision and cast as it is loaded: half the file."""
    graph, casts = proto.graph, list[onnx.NodeProto]()
    for tensor in graph.initializer:
        values = numpy_helper.to_array(tensor)
        if values.dtype == np.float32 and values.size >= HALVED_FROM:
            name = tensor.name
            tensor.CopyFrom(numpy_helper.from_array(values.astype(np.float16), f"{name}.half"))
            casts.append(helper.make_node("Cast", [f"{name}.half"], [name], to=onnx.TensorProto.FLOAT))
    nodes = [*casts, *graph.node]
    del graph.node[:]
    graph.node.extend(nodes)
    return proto


def shortened(proto: onnx.ModelProto) -> onnx.ModelProto:
    """Return the same graph with numbers for the names inside it, which are half of a small model's file.

    Raises:
        ValueError: a node holds a graph of its own, whose names it would have to know, too.
    """
    graph = proto.graph
    if any(attribute.HasField("g") or attribute.graphs for node in graph.node for attribute in node.attribute):
        raise ValueError("a node of the traced graph holds another graph")
    names = {value.name: value.name for value in (*graph.input, *graph.output)} | {"": ""}

    def short(name: str) -> str:
        return names.setdefault(name, str(len(names)))

    for tensor in graph.initializer:
        tensor.name = short(tensor.name)
    for node in graph.node:
        node.name = ""
        node.input[:] = [short(name) for name in node.input]
        node.output[:] = [short(name) for name in node.output]
    del graph.value_info[:]
    return proto
