"""A network whose answers can be worked out by hand, as two ONNX graphs with the inputs and outputs of ours."""

from pathlib import Path

import onnx
from onnx import parser

FIRST = """
<ir_version: 10, opset_import: ["": 18]>
fake_first (float[1, 30, h, w] voxels, float[1, 24, h, w] fits, float[1, 22, c, d] candidates,
    float[1, 1, h, w] valid, float[1, 4] intrinsics, float[1, 4] rotation)
  => (float[1, 1, c, d] rel_depth, float[1, 6] ego, float[1, 2, c, d] flow, float[1, 2, c, d] rigid)
{
  channels = Constant <value_ints = [1]> ()
  some = ReduceMean <keepdims = 1> (candidates, channels)
  nothing = Sub (some, some)
  one = Constant <value_float = 1.0> ()
  rel_depth = Add (nothing, one)
  flow = Concat <axis = 1> (nothing, nothing)
  rigid = Concat <axis = 1> (nothing, nothing)
  all = ReduceMean <keepdims = 1> (voxels)
  row = Constant <value_ints = [1, 1]> ()
  activity = Reshape (all, row)
  small = Constant <value_float = 0.01> ()
  sideways = Mul (activity, small)
  five = Constant <value_floats = [0.0, 0.0, 0.0, 0.0, 0.0]> ()
  nought = Constant <value_ints = [0]> ()
  rest = Unsqueeze (five, nought)
  ego = Concat <axis = 1> (sideways, rest)
}
"""
SECOND = """
<ir_version: 10, opset_import: ["": 18]>
fake_second (float[1, 30, H, W] voxels, float[1, 24, h, w] fits, float[1, 1, h, w] valid, float[1, 4] intrinsics,
    float[1, 4] rotation, float[1, 6] taken_ego, float[1, 1, c, d] taken_depth, float[1, 2, c, d] taken_rigid,
    float[1, 2, c, d] taken_seen)
  => (float[1, 1, h, w] moving, float[1, 1, h, w] rel_depth, float[1, 6] ego,
      float[1, 3, h, w] velocity, float[1, 2, h, w] flow)
{
  channels = Constant <value_ints = [1]> ()
  at_positive = Constant <value_ints = [12, 14, 16]> ()
  at_negative = Constant <value_ints = [13, 15, 17]> ()
  on = Gather <axis = 1> (voxels, at_positive)
  off = Gather <axis = 1> (voxels, at_negative)
  either = Max (on, off)
  highest = MaxPool <kernel_shape = [2, 2], strides = [2, 2]> (either)
  most = ReduceMax <keepdims = 1> (highest, channels)
  least = Constant <value_float = 0.3> ()
  busy = Greater (most, least)
  probability = Cast <to = 1> (busy)
  moving = Mul (probability, valid)
  halved = AveragePool <kernel_shape = [2, 2], strides = [2, 2]> (voxels)
  activity = ReduceMean <keepdims = 1> (halved, channels)
  depth = ReduceMean <keepdims = 1> (taken_depth)
  rel_depth = Add (activity, depth)
  more = Sub (on, off)
  pooled = AveragePool <kernel_shape = [2, 2], strides = [2, 2]> (more)
  balance = ReduceMean <keepdims = 1> (pooled, channels)
  sign = Sign (balance)
  nothing = Sub (sign, sign)
  velocity = Concat <axis = 1> (sign, nothing, nothing)
  left = Sub (taken_seen, taken_rigid)
  drift = ReduceMean <keepdims = 1> (left)
  drifting = Add (nothing, drift)
  flow = Concat <axis = 1> (sign, drifting)
  ending = Constant <value_floats = [5.0, 6.0]> ()
  nought = Constant <value_ints = [0]> ()
  row = Unsqueeze (ending, nought)
  at_known = Constant <value_ints = [2, 3]> ()
  known = Gather <axis = 1> (rotation, at_known)
  sum = Add (row, known)
  ego = Concat <axis = 1> (intrinsics, sum)
}
"""


def save_fake_network(path: Path, **facts: str) -> Path:
    """Save both passes for any image size, with other metadata if `facts` are given.

    First pass: rel_depth 1, flow and rigid 0, ego (mean of all voxels / 100, 0 0 0 0 0).

    Second pass: moving 1 where the middle slice has most of an event in one pixel; rel_depth mean of `taken_depth` +
    mean of all 30 channels; ego fx fy cx cy, 5 + rotation z, 6 + whether it is known; velocity (sign of positive -
    negative counts, 0, 0); flow (the same sign, mean of what was seen - mean of what was taken out).
    """
    known = {"config": '{"hidden": 8}', "stride": "4"} | facts
    for text, place in ((SECOND, path), (FIRST, path.with_name(f"{path.stem}.first.onnx"))):
        model = parser.parse_model(text)
        onnx.helper.set_model_props(model, known)
        onnx.checker.check_model(model)
        onnx.save(model, str(place))
    return path
