"""Calibration files: what was written is read back, and strangers' files end in our errors."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from evimo.errors import BadFile, BadInput, EvimoError, NotFound
from evimo.geometry.calibration import load_camera
from evimo.geometry.camera import Camera

KALIBR = """\
cam0:
  camera_model: pinhole
  distortion_coeffs: [-0.36, 0.12, -0.0001, 0.0002]
  distortion_model: radtan
  intrinsics: [257.5, 257.25, 188.5, 131.5]
  resolution: [346, 260]
  rostopic: /dvs/image_raw
"""
SECOND = """\
cam1:
  T_cn_cnm1: [[1, 0, 0, 0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
  camera_model: pinhole
  distortion_coeffs: [0.1, 0.2, 0.3, 0.4]
  distortion_model: equidistant
  intrinsics: [500.0, 501.0, 320.0, 240.0]
  resolution: [640, 480]
"""
ROS = """\
image_width: 240
image_height: 180
camera_name: DAVIS240
camera_matrix: {rows: 3, cols: 3, data: [250, 0, 120, 0, 251, 90, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.38, 0.15, 0.001, 0.002, 0.003]}
"""
DV = """\
<?xml version="1.0"?>
<opencv_storage>
<DAVIS346_00000133>
  <camera_matrix type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt>
    <data>
      2.5e+02 0. 1.5e+02 0.
      2.6e+02 1.1e+02 0. 0. 1.</data></camera_matrix>
  <distortion_coefficients type_id="opencv-matrix"><rows>5</rows><cols>1</cols><dt>d</dt>
    <data>
      -5.0e-01 4.0e-01 -1.0e-03 -2.0e-03
      -3.0e-01</data></distortion_coefficients>
  <image_width>346</image_width>
  <image_height>260</image_height></DAVIS346_00000133>
<use_fisheye_model>0</use_fisheye_model>
</opencv_storage>
"""
EVIMO = "254.5 251.5 188.5 154.5 -0.34 0.08 -0.003 -0.005\n"


@pytest.fixture
def written(tmp_path):
    def write(text, name="calib.txt"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


def test_kalibr(written):
    expected = Camera(257.5, 257.25, 188.5, 131.5, 260, 346, (-0.36, 0.12, -0.0001, 0.0002))
    assert load_camera(written(KALIBR)) == expected
    assert load_camera(str(written(KALIBR)), size=(260, 346)) == expected


def test_camchain_gives_the_camera_of_that_size(written):
    chain = written(KALIBR + SECOND)
    second = Camera(500.0, 501.0, 320.0, 240.0, 480, 640, (0.1, 0.2, 0.3, 0.4), "fisheye")
    assert load_camera(chain, size=(480, 640)) == second
    with pytest.raises(BadInput, match=r"2 of its cameras fit: cam0 \(/dvs/image_raw\), cam1\n  try: --camera NAME"):
        load_camera(chain)


def test_ros(written):
    assert load_camera(written(ROS)) == Camera(250.0, 251.0, 120.0, 90.0, 180, 240, (-0.38, 0.15, 0.001, 0.002, 0.003))


def test_opencv_header_is_tolerated(written):
    assert load_camera(written("%YAML:1.0\n---\n" + ROS)).size == (180, 240)


def test_no_distortion_model_is_a_pinhole(written):
    bare = written("intrinsics: [200, 200, 100, 90]\nresolution: [240, 180]\n")
    assert load_camera(bare) == Camera(200.0, 200.0, 100.0, 90.0, 180, 240)


def test_evimo_calib_txt_takes_the_size_from_the_caller(written):
    assert load_camera(written(EVIMO), size=(260, 346)) == Camera(
        254.5, 251.5, 188.5, 154.5, 260, 346, (-0.34, 0.08, -0.003, -0.005)
    )
    with pytest.raises(BadInput, match="size of its sensor"):
        load_camera(written(EVIMO))


def test_convention_res_x_of_params_txt_counts_rows(written):
    written("res_x: 480\nres_y: 640\ndist_model: equidistant\n", "params.txt")
    camera = load_camera(written(EVIMO))
    assert (camera.size, camera.lens) == ((480, 640), "fisheye")


def test_dv_xml(written):
    assert load_camera(written(DV)) == Camera(250.0, 260.0, 150.0, 110.0, 260, 346, (-0.5, 0.4, -0.001, -0.002, -0.3))


def test_dv_fisheye(written):
    text = DV.replace("<use_fisheye_model>0", "<use_fisheye_model>1").replace("\n      -3.0e-01", "")
    camera = load_camera(written(text))
    assert (camera.lens, camera.distortion) == ("fisheye", (-0.5, 0.4, -0.001, -0.002))


@pytest.mark.parametrize("text", [KALIBR, ROS, DV], ids=["kalibr", "ros", "dv"])
def test_a_calibration_of_another_sensor_is_refused(written, text):
    with pytest.raises(BadInput, match="the sensor is 1280x720"):
        load_camera(written(text), size=(720, 1280))


NESTED = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{one}: &{one} [{', '.join([f'*{before}'] * 9)}]\n" for before, one in zip("abcdefgh", "bcdefghi", strict=True)
)
BAD = {
    "empty": "",
    "prose": "this is not a calibration",
    "binary": b"\x89PNG\r\n\x1a\n\xff\xfe",
    "list": "- 1\n- 2\n",
    "truncated yaml": KALIBR[:80],
    "broken yaml": "cam0: [1, 2",
    "python object": "cam0: !!python/object/apply:os.system ['true']\n",
    "many aliases": NESTED + "intrinsics: *i\nresolution: [346, 260]\n",
    "aliases for a lens": KALIBR.replace("cam0:", NESTED + "cam0:").replace("radtan", "*i"),
    "aliases for a model": KALIBR.replace("cam0:", NESTED + "cam0:").replace("pinhole", "*i"),
    "deep yaml": "intrinsics: " + "[" * 1_000,
    "omnidirectional": KALIBR.replace("pinhole", "omni"),
    "unknown lens": KALIBR.replace("radtan", "fov"),
    "words": KALIBR.replace("257.5", "wide"),
    "nan": KALIBR.replace("257.5", ".nan"),
    "negative focal length": KALIBR.replace("257.5", "-257.5"),
    "half a size": ROS.replace("image_width", "x"),
    "no pixels": KALIBR.replace("[346, 260]", "[0, 260]"),
    "three intrinsics": KALIBR.replace("257.5, ", ""),
    "three coefficients": KALIBR.replace("0.12, ", ""),
    "transposed matrix": ROS.replace("250, 0, 120, 0, 251, 90, 0, 0, 1", "250, 0, 0, 0, 251, 0, 120, 90, 1")
    .replace("240", "346")
    .replace("180", "260"),
    "seven numbers": "1 2 3 4 5 6 7",
    "not finite": "254 251 nan 154 0 0 0 0",
    "truncated xml": DV[:400],
    "foreign xml": "<html><body/></html>",
    "xml entities": '<!DOCTYPE x [<!ENTITY a "b">]><opencv_storage>&a;</opencv_storage>',
    "deep xml": "<a>" * 30_000,
    "xml with half a size": DV.replace("image_width", "x"),
    "large": " " * 200_000,
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files_end_in_one_clear_error(written, name):
    with pytest.raises(BadFile, match=r"calib\.txt") as error:
        load_camera(written(BAD[name]), size=(260, 346))
    assert len(str(error.value)) < 600


def test_a_missing_file_is_not_found(tmp_path):
    with pytest.raises(NotFound, match=r"no\.yaml"):
        load_camera(tmp_path / "no.yaml")


@given(text=st.one_of(st.text(max_size=60), st.sampled_from([KALIBR, ROS, DV, EVIMO])), cut=st.integers(0, 900))
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_cut_and_random_files_end_in_a_camera_or_our_error(tmp_path, text, cut):
    path = tmp_path / "calib.txt"
    path.write_text(text[:cut], encoding="utf-8", errors="replace")
    try:
        assert load_camera(path, size=(260, 346)).size == (260, 346)
    except EvimoError as error:
        assert error.fix


def test_published_calibrations(shared_data):
    folder = shared_data("calibration")
    official = load_camera(folder / "evimo1_calib.yaml")
    assert official == load_camera(folder / "published_intrinsics/EV_IMO/calib.yaml")
    assert official.size == (260, 346) and official.fx == pytest.approx(257.682551525072)
    assert load_camera(folder / "published_intrinsics/EED/calib.yaml").is_pinhole
    sizes = {path.parent.name: load_camera(path).size for path in (folder / "rig/config").glob("*/calib.txt")}
    assert sizes["davis_346_radtan"] == (260, 346) and sizes["left_camera"] == sizes["right_camera"] == (480, 640)
    assert load_camera(folder / "rig/config/structure_core/calib.txt").lens == "fisheye"
