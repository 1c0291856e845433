"""A trained model to one ONNX graph: geometry and mixture inside, any image size, no torch to run it."""

import json
import os
import tempfile
import warnings
from dataclasses import asdict
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import torch
from onnx import helper, numpy_helper
from torch import Tensor, nn

from evimo.model.evidence import CHANNELS, Evidence
from evimo.model.motion_net import MotionNet

INPUTS = ("image", "evidence", "valid", "intrinsics")
OUTPUTS = ("moving", "rel_depth", "ego", "velocity", "flow")
HALVED_FROM = 1024  # elements of a weight that is stored in half precision


class Deployed(nn.Module):
    """The finest scale of a model, at half the size of the frames."""

    def __init__(self, model: MotionNet) -> None:
        super().__init__()
        self.model = model

    def forward(self, image: Tensor, evidence: Tensor, valid: Tensor, intrinsics: Tensor) -> tuple[Tensor, ...]:
        """The outputs in the order of `OUTPUTS`; the images are half the padded frames (`MotionNet.padded`).

        Args:
            image: (1, 3 N, h, w) log counts and mean times, see `MotionNet.answers`.
            evidence: (1, 22, a, b) see `Evidence.unpacked`.
            valid: (1, 1, h, w) share of each pixel that the lens sees.
            intrinsics: (1, 4) fx fy cx cy of the full size, px.

        Returns:
            moving (1, 1, h, w) probability; rel_depth (1, 1, h, w); ego (1, 6) mean depths per second and rad/s;
            velocity (1, 3, h, w) of each pixel if it moves, mean depths per second; flow (1, 2, h, w) 1/s on Z = 1.
        """
        finest = self.model.answers(image, Evidence.unpacked(evidence), valid, intrinsics)[-1]
        moving = 1 - finest.mixture[:, :1]
        return moving, finest.rel_depth, finest.ego, finest.object_velocity, finest.flow


def export(model: MotionNet, path: Path) -> None:
    """Write a model as ONNX that takes images of any size; the configuration is in its metadata under `config`."""
    config = model.config
    cell = config.stride // 2
    height, width = 4 * cell, 5 * cell
    example = (
        torch.rand(1, 3 * config.slices, height, width),
        torch.rand(1, CHANNELS, height // config.evidence_reduction, width // config.evidence_reduction),
        torch.ones(1, 1, height, width),
        torch.tensor([[1.5 * width, 1.5 * width, width, height]]),
    )
    free = {name: {2: "height", 3: "width"} for name in ("image", "valid", *(n for n in OUTPUTS if n != "ego"))}
    with warnings.catch_warnings(), torch.no_grad(), tempfile.TemporaryDirectory() as folder:
        warnings.simplefilter("ignore")  # the exporter's own, about itself
        traced = Path(folder) / "traced.onnx"
        # By tracing: the exporter of torch.export takes ten minutes over this graph's symbolic sizes.
        torch.onnx.export(
            Deployed(model).eval(),
            example,
            str(traced),
            dynamo=False,
            opset_version=18,
            input_names=list(INPUTS),
            output_names=list(OUTPUTS),
            dynamic_axes=free | {"evidence": {2: "cells_high", 3: "cells_wide"}},
        )
        proto = halved(folded(traced))
    facts = {"config": asdict(config), "stride": config.stride, "evidence_reduction": config.evidence_reduction}
    for key, value in facts.items():
        entry = proto.metadata_props.add()
        entry.key, entry.value = key, json.dumps(value)
    onnx.checker.check_model(proto)
    partial = path.with_name(f".partial-{os.getpid()}-{path.name}")
    onnx.save(proto, partial)
    partial.replace(path)


def folded(traced: Path) -> onnx.ModelProto:
    """The graph with constants folded and dead ends cut: half as many nodes, and quick to load."""
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
