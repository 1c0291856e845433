"""Two passes whose answers can be worked out by hand, as ONNX with the inputs and outputs of ours."""

from pathlib import Path

import onnx
from onnx import parser

HEADER = '<ir_version: 10, opset_import: ["": 18]>'
FIRST = """
first (float[1, 30, h, w] voxels, float[1, 24, h, w] fits, float[1, 22, a, b] candidates, float[1, 1, h, w] valid,
       float[1, 4] intrinsics, float[1, 4] rotation)
  => (float[1, 1, a, b] rel_depth, float[1, 6] ego, float[1, 2, a, b] flow)
{
  quarter = AveragePool <kernel_shape = [2, 2], strides = [2, 2]> (valid)
  nothing = Sub (quarter, quarter)
  two = Constant <value_float = 2.0> ()
  rel_depth = Add (nothing, two)
  one = Constant <value_float = 1.0> ()
  ones = Add (nothing, one)
  flow = Concat <axis = 1> (ones, nothing)
  all = Constant <value_ints = [1, 2, 3]> ()
  mean = ReduceMean <keepdims = 0> (voxels, all)
  little = Constant <value_float = 0.02> ()
  speed = Mul (mean, little)
  column = Constant <value_ints = [1]> ()
  row = Unsqueeze (speed, column)
  rest = Constant <value_floats = [0.0, 0.0, 0.0, 0.0, 0.0]> ()
  nought = Constant <value_ints = [0]> ()
  still = Unsqueeze (rest, nought)
  ego = Concat <axis = 1> (row, still)
}
"""
SECOND = """
second (float[1, 30, H, W] voxels, float[1, 24, h, w] fits, float[1, 1, h, w] valid, float[1, 4] intrinsics,
        float[1, 4] rotation, float[1, 6] taken_ego, float[1, 1, a, b] taken_depth,
        float[1, 2, a, b] taken_seen)
  => (float[1, 1, h, w] moving, float[1, 1, h, w] rel_depth, float[1, 6] ego, float[1, 3, h, w] velocity,
      float[1, 2, h, w] flow, float[1, 1, h, w] confidence)
{
  half = AveragePool <kernel_shape = [2, 2], strides = [2, 2]> (voxels)
  of_positive = Constant <value_ints = [12, 14, 16]> ()
  of_negative = Constant <value_ints = [13, 15, 17]> ()
  all_positive = Gather <axis = 1> (half, of_positive)
  all_negative = Gather <axis = 1> (half, of_negative)
  channels = Constant <value_ints = [1]> ()
  positive = ReduceSum <keepdims = 1> (all_positive, channels)
  negative = ReduceSum <keepdims = 1> (all_negative, channels)
  count = Add (positive, negative)
  least = Constant <value_float = 0.3> ()
  busy = Greater (count, least)
  probability = Cast <to = 1> (busy)
  moving = Mul (probability, valid)
  activity = ReduceMean <keepdims = 1> (half, channels)
  slopes = ReduceMean <keepdims = 1> (fits, channels)
  nearly = Add (activity, slopes)
  one = Constant <value_float = 1.0> ()
  rel_depth = Add (nearly, one)
  quarter = Constant <value_float = 0.25> ()
  confidence = Mul (valid, quarter)
  more = Sub (positive, negative)
  sign = Sign (more)
  nothing = Sub (sign, sign)
  velocity = Concat <axis = 1> (sign, nothing, nothing)
  flow = Concat <axis = 1> (sign, nothing)
  x = Constant <value_ints = [0]> ()
  speed = Gather <axis = 1> (taken_ego, x)
  inner = Constant <value_ints = [2, 3]> ()
  by_axis = ReduceMean <keepdims = 0> (taken_seen, inner)
  seen = Gather <axis = 1> (by_axis, x)
  ego = Concat <axis = 1> (intrinsics, speed, seen)
}
"""


def save_fake_network(path: Path, first: dict[str, str] | None = None, **facts: str) -> Path:
    """Save both passes for any image size, the first beside the second; with other metadata if `facts` are given.

    The first pass says: depth 2 everywhere, a camera that moves 0.02 times the mean of all voxels along x, a flow of
    1 px along x. The second: moving where the middle slice has events; rel_depth
    1 + mean voxel + mean fit; ego fx fy cx cy, the speed and the flow of the first pass; velocity and flow (sign of
    positive - negative count, 0, …).
    """
    common = {"config": '{"hidden": 8}', "stride": "8"} | facts
    for text, at, said in (
        (SECOND, path, common),
        (FIRST, path.with_name(f"{path.stem}.first.onnx"), common | (first or {})),
    ):
        model = parser.parse_model(HEADER + text)
        onnx.helper.set_model_props(model, said)
        onnx.checker.check_model(model)
        onnx.save(model, str(at))
    return path
