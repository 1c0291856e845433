"""A network whose answers can be worked out by hand, as ONNX with the inputs and outputs of ours."""

from pathlib import Path

import onnx
from onnx import parser

MODEL = """
<ir_version: 10, opset_import: ["": 18]>
fake (float[1, 5, 3, {h}, {w}] frames, float[1, 1, {h}, {w}] valid, float[1, 4] intrinsics)
  => (float[1, 1, {h}, {w}] moving, float[1, 1, {h}, {w}] rel_depth, float[1, 6] ego,
      float[1, 3, {h}, {w}] velocity, float[1, 2, {h}, {w}] flow)
{{
  middle = Constant <value_int = 2> ()
  centre = Gather <axis = 1> (frames, middle)
  positive, negative, time = Split <axis = 1, num_outputs = 3> (centre)
  count = Add (positive, negative)
  half = Constant <value_float = 0.5> ()
  busy = Greater (count, half)
  probability = Cast <to = 1> (busy)
  moving = Mul (probability, valid)
  all_frames = Constant <value_ints = [1, 2]> ()
  activity = ReduceMean <keepdims = 0> (frames, all_frames)
  first = Constant <value_ints = [1]> ()
  plane = Unsqueeze (activity, first)
  one = Constant <value_float = 1.0> ()
  rel_depth = Add (plane, one)
  sign = Sub (positive, negative)
  nothing = Sub (sign, sign)
  velocity = Concat <axis = 1> (sign, nothing, nothing)
  flow = Concat <axis = 1> (sign, nothing)
  ending = Constant <value_floats = [5.0, 6.0]> ()
  nought = Constant <value_ints = [0]> ()
  row = Unsqueeze (ending, nought)
  ego = Concat <axis = 1> (intrinsics, row)
}}
"""


def save_fake_network(path: Path, *, size: tuple[int, int] | None = None, config: str = '{"hidden": 8}') -> Path:
    """Save it for any image size, or for one (height, width) only.

    moving: 1 where the reference slice has an event; rel_depth: 1 + mean of all 15 frames; ego: fx fy cx cy 5 6;
    velocity and flow: (positive - negative count, 0, …).
    """
    height, width = size or ("h", "w")
    model = parser.parse_model(MODEL.format(h=height, w=width))
    onnx.helper.set_model_props(model, {"config": config})
    onnx.checker.check_model(model)
    onnx.save(model, str(path))
    return path
