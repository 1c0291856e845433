"""A network whose answers can be worked out by hand, as ONNX with the inputs and outputs of ours."""

from pathlib import Path

import onnx
from onnx import parser

MODEL = """
<ir_version: 10, opset_import: ["": 18]>
fake (float[1, 15, {h}, {w}] image, float[1, 22, a, b] evidence, float[1, 1, {h}, {w}] valid, float[1, 4] intrinsics)
  => (float[1, 1, {h}, {w}] moving, float[1, 1, {h}, {w}] rel_depth, float[1, 6] ego,
      float[1, 3, {h}, {w}] velocity, float[1, 2, {h}, {w}] flow)
{{
  at_positive = Constant <value_ints = [4]> ()
  at_negative = Constant <value_ints = [5]> ()
  positive = Gather <axis = 1> (image, at_positive)
  negative = Gather <axis = 1> (image, at_negative)
  count = Add (positive, negative)
  least = Constant <value_float = 0.2> ()
  busy = Greater (count, least)
  probability = Cast <to = 1> (busy)
  moving = Mul (probability, valid)
  channels = Constant <value_ints = [1]> ()
  activity = ReduceMean <keepdims = 1> (image, channels)
  seen = ReduceMean <keepdims = 1> (evidence)
  nearly = Add (activity, seen)
  one = Constant <value_float = 1.0> ()
  rel_depth = Add (nearly, one)
  more = Sub (positive, negative)
  sign = Sign (more)
  nothing = Sub (sign, sign)
  velocity = Concat <axis = 1> (sign, nothing, nothing)
  flow = Concat <axis = 1> (sign, nothing)
  ending = Constant <value_floats = [5.0, 6.0]> ()
  nought = Constant <value_ints = [0]> ()
  row = Unsqueeze (ending, nought)
  ego = Concat <axis = 1> (intrinsics, row)
}}
"""


def save_fake_network(path: Path, **facts: str) -> Path:
    """Save it for any image size, with other metadata if `facts` are given.

    moving: 1 where the reference slice has an event; rel_depth: 1 + mean of all 15 channels + mean evidence; ego: fx fy
    cx cy 5 6; velocity and flow: (sign of positive - negative count, 0, …).
    """
    model = parser.parse_model(MODEL.format(h="h", w="w"))
    onnx.helper.set_model_props(model, {"config": '{"hidden": 8}', "stride": "4", "evidence_reduction": "2"} | facts)
    onnx.checker.check_model(model)
    onnx.save(model, str(path))
    return path
