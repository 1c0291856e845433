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

from evimo.model.backbone import enlarged
from evimo.model.motion_net import MotionNet

INPUTS = ("frames", "valid", "intrinsics")
OUTPUTS = ("moving", "rel_depth", "ego", "velocity", "flow")


class Deployed(nn.Module):
    """The finest scale of a model, enlarged to the image's size."""

    def __init__(self, model: MotionNet) -> None:
        super().__init__()
        self.model = model

    def forward(self, frames: Tensor, valid: Tensor, intrinsics: Tensor) -> tuple[Tensor, ...]:
        """The outputs in the order of `OUTPUTS`; sides of the images are multiples of the model's stride.

        Args:
            frames: (1, N, 3, H, W) event frames.
            valid: (1, 1, H, W) float, 1 where the lens sees the pixel.
            intrinsics: (1, 4) fx fy cx cy, px.

        Returns:
            moving (1, 1, H, W) probability; rel_depth (1, 1, H, W); ego (1, 6) mean depths per second and rad/s;
            velocity (1, 3, H, W) of each pixel if it moves, mean depths per second; flow (1, 2, H, W) 1/s on Z = 1.
        """
        finest = self.model.padded(frames, valid, intrinsics)[-1]
        maps = torch.cat((1 - finest.mixture[:, :1], finest.rel_depth, finest.object_velocity, finest.flow), dim=1)
        moving, rel_depth, velocity, flow = enlarged(maps, 2).split((1, 1, 3, 2), dim=1)
        return moving, rel_depth, finest.ego, velocity, flow


def export(model: MotionNet, path: Path) -> None:
    """Write a model as ONNX that takes images of any size; the configuration is in its metadata under `config`."""
    stride, slices = model.config.stride, model.config.slices
    height, width = 8 * stride, 10 * stride
    example = (
        torch.rand(1, slices, 3, height, width),
        torch.ones(1, 1, height, width),
        torch.tensor([[0.75 * width, 0.75 * width, width / 2, height / 2]]),
    )
    free = {"padded_frames": {3: "height", 4: "width"}, "padded_valid": {2: "height", 3: "width"}}
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
            input_names=["padded_frames", "padded_valid", "intrinsics"],
            output_names=[f"padded_{name}" if name != "ego" else name for name in OUTPUTS],
            dynamic_axes=free,
        )
        proto = padded_and_cropped(folded(traced), stride)
    entry = proto.metadata_props.add()
    entry.key, entry.value = "config", json.dumps(asdict(model.config))
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


def padded_and_cropped(core: onnx.ModelProto, stride: int) -> onnx.ModelProto:
    """Put before a graph what pads any image to a multiple of the stride, and behind it what crops the maps again."""
    graph = core.graph
    constants = {"stride": [stride], "image_axes": [-2, -1], "origin": [0, 0]}
    graph.initializer.extend(numpy_helper.from_array(np.array(v, np.int64), f"pad_{k}") for k, v in constants.items())
    before = [
        helper.make_node("Shape", ["valid"], ["pad_size"], start=-2),
        helper.make_node("Neg", ["pad_size"], ["pad_negative"]),
        helper.make_node("Mod", ["pad_negative", "pad_stride"], ["pad_missing"]),
        helper.make_node("Concat", ["pad_origin", "pad_missing"], ["pad_amounts"], axis=0),
        helper.make_node("Pad", ["frames", "pad_amounts", "", "pad_image_axes"], ["padded_frames"]),
        helper.make_node("Pad", ["valid", "pad_amounts", "", "pad_image_axes"], ["padded_valid"]),
    ]
    maps = [name for name in OUTPUTS if name != "ego"]
    behind = [
        helper.make_node("Slice", [f"padded_{name}", "pad_origin", "pad_size", "pad_image_axes"], [name])
        for name in maps
    ]
    nodes = [*before, *graph.node, *behind]
    del graph.node[:]
    graph.node.extend(nodes)
    for value in (*graph.input, *graph.output):
        if value.name.startswith("padded_"):
            value.name = value.name.removeprefix("padded_")
            for axis, letter in ((-2, "height"), (-1, "width")):
                value.type.tensor_type.shape.dim[axis].dim_param = letter
    return core
