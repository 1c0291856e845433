"""The dictionary `meta` with what Python or JSON can write and no camera has: one error each, in little memory."""

import numpy as np
import pytest

from evimo.errors import BadFile
from evimo.formats.evimo2 import mapped
from evimo.formats.evimo_meta import literal, meta_of
from evimo.recordings.dataset_cameras import AS_WRITTEN, camera_of


@pytest.mark.parametrize("text", ["[" * 200_000, "{[1]: 2}", "{'meta': {}, " + "(" * 500])
def test_text_that_no_parser_takes_is_one_error(text):
    with pytest.raises(BadFile, match="no literal"):
        literal(text, "meta")


def test_numbers_beyond_any_float_are_one_error():
    with pytest.raises(BadFile, match="no number"):
        meta_of({"meta": {}, "frames": [{"ts": 10**400}]}, "meta")
    with pytest.raises(BadFile, match="no camera"):
        camera_of({"fx": 10**400, "fy": 1, "cx": 1, "cy": 1}, (4, 4), AS_WRITTEN, "meta")


def test_a_value_that_multiplies_itself_is_one_error():
    value = ["x"]
    for _ in range(60):
        value = [value, value]
    with pytest.raises(BadFile, match="no number"):
        meta_of({"meta": {}, "frames": [{"ts": value}]}, "meta")


def test_only_whole_numbers_name_objects():
    pose = {"pos": {"t": {"x": 0, "y": 0, "z": 1}, "q": {"w": 1, "x": 0, "y": 0, "z": 0}}}
    frames = meta_of({"meta": {}, "frames": [{"ts": 0, "cam": pose, "²": pose, "3": pose, "300": pose}]}, "it").frames
    assert list(frames.cam_from_object) == [3]
    np.testing.assert_array_equal(frames.cam_from_object[3][0, :3, 3], (0, 0, 1))


@pytest.mark.parametrize("shape", [(), (5, 0)])
def test_arrays_of_no_rows_and_columns_are_one_error(tmp_path, shape):
    np.save(tmp_path / "a.npy", np.zeros(shape))
    with pytest.raises(BadFile, match="shape"):
        mapped(tmp_path / "a.npy")
