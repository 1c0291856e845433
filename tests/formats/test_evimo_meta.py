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


def test_the_third_radial_coefficient_is_kept_where_it_is_one():
    """EVIMO2 names it, and stores it behind its tangential ones; EV-IMO's first version calls a tangential one so."""
    numbers = {"fx": 50, "fy": 50, "cx": 31, "cy": 23, "k1": 0.1, "k2": 0.2, "k3": 0.3, "k4": 0.4}
    newer = numbers | {"dist_model": "radtan", "p1": 0.5, "p2": 0.6}
    assert camera_of(newer, (48, 64), AS_WRITTEN, "meta").distortion == (0.1, 0.2, 0.5, 0.6, 0.3)
    assert camera_of(newer | {"k3": 0.0}, (48, 64), AS_WRITTEN, "meta").distortion == (0.1, 0.2, 0.5, 0.6)
    assert camera_of(numbers, (48, 64), AS_WRITTEN, "meta").distortion == (0.1, 0.2, 0.3, 0.4)


@pytest.mark.parametrize("shape", [(), (5, 0)])
def test_arrays_of_no_rows_and_columns_are_one_error(tmp_path, shape):
    np.save(tmp_path / "a.npy", np.zeros(shape))
    with pytest.raises(BadFile, match="shape"):
        mapped(tmp_path / "a.npy")
