"""A network that finds no objects, from stacks to files: what it does not say is missing everywhere, never nothing."""

import json

import h5py
import numpy as np
import onnx
import pytest
from onnx import parser

from evimo.errors import BadFile, BadInput, EvimoWarning
from evimo.events.events import joined
from evimo.recordings.prediction import prediction_of
from evimo.streaming.models import model_of
from evimo.streaming.one_look import OneLookNetwork
from evimo.streaming.pipeline import Run, run
from evimo.streaming.saving import Wanted, save_run

HEADER = '<ir_version: 10, opset_import: ["": 18]>'
ONLY = """
only (float[1, 30, h, w] voxels, float[1, 1, h, w] valid, float[1, 4] intrinsics)
  => (float[1, 1, h, w] rel_depth, float[1, 6] ego, float[1, 2, h, w] flow, float[1, 1, h, w] confidence)
{
  channels = Constant <value_ints = [1]> ()
  activity = ReduceMean <keepdims = 1> (voxels, channels)
  one = Constant <value_float = 1.0> ()
  rel_depth = Add (activity, one)
  nothing = Sub (valid, valid)
  half = Constant <value_float = 0.5> ()
  right = Add (nothing, half)
  flow = Concat <axis = 1> (right, nothing)
  confidence = Mul (valid, half)
  fxy = Constant <value_ints = [0, 1]> ()
  focal = Gather <axis = 1> (intrinsics, fxy)
  ego = Concat <axis = 1> (intrinsics, focal)
}
"""


@pytest.fixture(scope="module")
def only(tmp_path_factory):
    """Says: depth 1 + mean voxel, flow 0.5 to the right, ego fx fy cx cy fx fy, confidence a half where seen."""
    path = tmp_path_factory.mktemp("model") / "only.onnx"
    model = parser.parse_model(HEADER + ONLY)
    onnx.helper.set_model_props(model, {"config": '{"hidden": 3}', "stride": "8"})
    onnx.save(model, str(path))
    return path


@pytest.fixture
def prepared(only, discs, recorded, camera):
    return lambda **how: Run(recorded(discs), model_of(only), camera=camera, **how)


def test_what_is_not_estimated_is_missing(only, discs, recorded, camera):
    estimates = list(run(recorded(discs), model=only, camera=camera))
    assert len(estimates) == 20
    for each in estimates:
        assert each.moving_probability is each.ids is each.objects is each.moving is None
        assert each.rel_depth[each.valid].min() >= 1 and each.rel_depth.max() > 1.05
        np.testing.assert_allclose(each.flow[:, each.valid], np.outer((0.5, 0), np.ones(each.valid.sum())), atol=1e-6)
        assert each.ego[:2].tolist() == each.ego[4:].tolist() and each.ego[0] > 0
        said = prediction_of(each)
        assert said.moving is said.ids is said.probability is said.velocity is None
        assert said.rel_depth is not None and said.ego is not None and said.flow is not None


def test_an_estimate_does_not_depend_on_the_span(only, discs, recorded, camera):
    whole = list(run(recorded(discs), model=only, camera=camera))
    part = list(run(recorded(discs), model=only, camera=camera, start_s=0.1, stop_s=0.2))
    assert len(part) >= 3
    (first,) = (k for k, each in enumerate(whole) if each.t_us == part[0].t_us)
    for ours, theirs in zip(whole[first:], part, strict=False):
        np.testing.assert_array_equal(ours.rel_depth, theirs.rel_depth)


def test_the_files_of_a_run_leave_objects_out(prepared, tmp_path):
    (tmp_path / "objects.csv").write_text("of another run")
    made = prepared()
    with pytest.warns(EvimoWarning, match=r"objects\.csv is from an earlier run"):
        saved = save_run(made, tmp_path, Wanted(dense=True, video_speed=0.25))
    assert {path.name for path in saved.files} == {"egomotion.csv", "estimates.h5", "summary.json", "video.mp4"}
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["objects_seen"] is summary["objects_seen_for_100_ms"] is None
    assert summary["model"]["config"] == {"hidden": 3} and len(summary["model"]["sha256"]) == 64
    with h5py.File(tmp_path / "estimates.h5") as maps:
        assert set(maps) == {"valid", "t_us", "has_events", "ego", "rel_depth", "confidence"}
        assert len(maps["t_us"]) == 20 and (maps["rel_depth"][:, 12, 16] > 0).all()


def test_slices_without_events_say_nothing_either(only, discs, recorded, camera, tmp_path):
    begin = (int(discs.t[0]) // 25_000 + 7) * 25_000
    at, till = np.searchsorted(discs.t, (begin, begin + 4 * 25_000)).tolist()
    few = recorded(joined([discs.part(0, at), discs.part(till, len(discs))]))
    made = Run(few, model_of(only), camera=camera)
    save_run(made, tmp_path, Wanted(dense=True, video_speed=None))
    assert made.finder.without_events > 0
    with h5py.File(tmp_path / "estimates.h5") as maps:
        assert not maps["has_events"][:].all() and "ids" not in maps


def test_events_belong_to_no_object(prepared):
    with pytest.raises(BadInput, match="finds no objects") as raised:
        prepared(event_labels=True)
    assert "--model small" in str(raised.value)


def test_a_gyroscope_is_not_read(only, discs, recorded, camera):
    def never():
        raise AssertionError("read")

    made = Run(recorded(discs, read_gyroscope=never), model_of(only), camera=camera)
    assert "not used" in made.rotation.said


def test_a_file_that_lacks_an_answer_is_refused(tmp_path):
    model = parser.parse_model(HEADER + ONLY.replace(", float[1, 1, h, w] confidence)", ")"))
    onnx.save(model, str(tmp_path / "less.onnx"))
    with pytest.raises(BadFile, match="lacks confidence"):
        model_of(tmp_path / "less.onnx")


def test_the_packaged_rival_looks_once():
    assert isinstance(model_of("ecn"), OneLookNetwork)
