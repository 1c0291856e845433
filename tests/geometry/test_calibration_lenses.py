"""Lenses under the names of more programs: camodocal, SVO, ORB-SLAM, basalt; numbers beside their names."""

import json

import cv2
import numpy as np
import pytest

from evimo.errors import BadFile, BadInput
from evimo.geometry.calibration import load_camera
from evimo.geometry.camera import Camera

SIZE = (260, 346)
FOCAL = (250.5, 251.5, 170.25, 131.75)
LENS = (-0.3, 0.12, 0.001, -0.002)
RADTAN, FISHEYE = Camera(*FOCAL, *SIZE, LENS), Camera(*FOCAL, *SIZE, LENS, "fisheye")
THREE = Camera(*FOCAL, *SIZE, (*LENS, 0.05))
SIDES = "image_width: 346\nimage_height: 260\n"


@pytest.fixture
def written(tmp_path):
    def write(text, name="calibration.txt"):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return write


def branch(name, **values):
    return f"{name}:\n" + "".join(f"   {key}: {value}\n" for key, value in values.items())


KANNALA_BRANDT = dict(zip(("k2", "k3", "k4", "k5"), LENS, strict=True))
PLACES = dict(zip(("mu", "mv", "u0", "v0"), FOCAL, strict=True))
CAMODOCAL = "%YAML:1.0\n---\nmodel_type: KANNALA_BRANDT\ncamera_name: cam0\n" + SIDES


@pytest.mark.parametrize(
    "text",
    [
        CAMODOCAL + branch("projection_parameters", **KANNALA_BRANDT, **PLACES),
        CAMODOCAL + branch("distortion_parameters", **KANNALA_BRANDT) + branch("projection_parameters", **PLACES),
    ],
)
def test_k2_to_k5_of_camodocal_are_a_fisheye(written, text):
    camera = load_camera(written(text))
    assert camera == FISHEYE
    x, y, z = 0.3, -0.2, 0.8  # its own formula: theta + k2 theta^3 + k3 theta^5 + …, in the direction of the point
    theta, phi = np.arccos(z / np.sqrt(x * x + y * y + z * z)), np.arctan2(y, x)
    radius = theta + sum(k * theta**power for k, power in zip(LENS, (3, 5, 7, 9), strict=True))
    expected = FOCAL[0] * radius * np.cos(phi) + FOCAL[2], FOCAL[1] * radius * np.sin(phi) + FOCAL[3]
    np.testing.assert_allclose(camera.project(np.array([x / z, y / z])), expected)
    matrix = np.array([[FOCAL[0], 0, FOCAL[2]], [0, FOCAL[1], FOCAL[3]], [0, 0, 1]])
    opencv = cv2.fisheye.distortPoints(np.array([[[x / z, y / z]]]), matrix, np.array(LENS))
    np.testing.assert_allclose(opencv[0, 0], expected)


def svo(kinds):
    cameras = [
        {
            "T_B_C": {"rows": 4, "cols": 4, "data": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]},
            "camera": {
                "distortion": {"parameters": {"cols": 1, "rows": 4, "data": list(LENS)}, "type": kind},
                "image_height": 260,
                "image_width": 346,
                "intrinsics": {"cols": 1, "rows": 4, "data": [FOCAL[0] + number, *FOCAL[1:]]},
                "label": name,
                "type": "pinhole",
            },
        }
        for number, (name, kind) in enumerate(kinds.items())
    ]
    return json.dumps({"cameras": cameras, "label": "rig"})


def test_cameras_in_a_list_as_svo_has_them(written):
    assert load_camera(written(svo({"dvs": "radial-tangential"}))) == RADTAN
    assert load_camera(written(svo({"dvs": "equidistant"}))) == FISHEYE
    path = written(svo({"left": "radial-tangential", "right": "equidistant"}))
    with pytest.raises(BadInput, match=r"2 of its cameras fit: cam0 \(left\), cam1 \(right\)"):
        load_camera(path)
    for name in ("right", "cam1"):
        camera = load_camera(path, camera=name)
        assert (camera.fx, camera.lens) == (251.5, "fisheye")
    with pytest.raises(BadFile, match="unknown lens model 'atan'"):
        load_camera(written(svo({"dvs": "atan"})))


def test_dv_processing_in_a_list(written):
    camera = {"name": "DVX", "resolution": [346, 260], "focalLength": FOCAL[:2], "principalPoint": FOCAL[2:]}
    tree = {"cameras": [camera | {"distortion": LENS, "distortionModel": "radialTangential"}]}
    assert load_camera(written(json.dumps(tree)), camera="dvx") == RADTAN


ORB = "%YAML:1.0\nCamera.type: {kind}\nCamera.width: 346\nCamera.height: 260\nCamera.fps: 30\n"


@pytest.mark.parametrize("camera", ["Camera", "Camera1"])
@pytest.mark.parametrize(
    ("kind", "names", "expected"),
    [("PinHole", ("k1", "k2", "p1", "p2"), RADTAN), ("KannalaBrandt8", ("k1", "k2", "k3", "k4"), FISHEYE)],
)
def test_orb_slam(written, camera, kind, names, expected):
    numbers = dict(zip(("fx", "fy", "cx", "cy", *names), (*FOCAL, *LENS), strict=True))
    lines = [f"{camera}.{name}: {value}" for name, value in numbers.items()]
    assert load_camera(written(ORB.format(kind=f'"{kind}"') + "\n".join(lines) + "\n")) == expected


@pytest.mark.parametrize("name", ["type", "camera_type", "model"])
def test_a_lens_may_be_called_a_type_or_a_model(written, name):
    tree = {"K": [250.5, 0, 170.25, 0, 251.5, 131.75, 0, 0, 1], "D": LENS, "img_size": [346, 260]}
    assert load_camera(written(json.dumps(tree | {name: "FISHEYE"}))) == FISHEYE
    assert load_camera(written(json.dumps(tree | {name: "PINHOLE"}))) == RADTAN
    assert load_camera(written(json.dumps(tree | {name: "event"}))) == RADTAN
    for other in ("OCam", "double_sphere", "omni"):
        with pytest.raises(BadFile, match="unknown lens model"):
            load_camera(written(json.dumps(tree | {name: other})))


@pytest.mark.parametrize("other", ["radtan", "none", "", "pinhole", "DAVIS346"])
def test_a_lens_that_has_a_name_of_its_own_keeps_it(written, other):
    tree = {"K": [250.5, 0, 170.25, 0, 251.5, 131.75, 0, 0, 1], "D": LENS, "img_size": [346, 260], "type": other}
    assert load_camera(written(json.dumps(tree | {"distortion_model": "equidistant"}))) == FISHEYE
    assert load_camera(written(json.dumps(tree))) == RADTAN
    with pytest.raises(BadFile, match="unknown lens model"):
        load_camera(written(json.dumps(tree | {"distortion_model": "radtan", "type": "omni"})))


@pytest.mark.parametrize("note", ["cam0.note: good", "cam0.rows: {}", "note.of: cam0"])
def test_a_dot_in_a_key_hides_no_camera_of_that_name(written, note):
    numbers = f"  intrinsics: {list(FOCAL)}\n  distortion_coeffs: {list(LENS)}\n"
    text = f"cam0:\n{numbers}  resolution: [346, 260]\n  distortion_model: radtan\n"
    assert load_camera(written(f"{note}\n{text}")) == load_camera(written(f"{text}{note}\n")) == RADTAN


def test_a_lens_within_the_intrinsics_is_not_left_out(written):
    numbers = dict(zip(("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"), (*FOCAL, *LENS), strict=True))
    assert load_camera(written(json.dumps({"intrinsics": numbers, "resolution": [346, 260]}))) == RADTAN


def test_basalt_without_sizes(written):
    numbers = dict(zip(("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"), (*FOCAL, *LENS), strict=True))
    tree = {"value0": {"intrinsics": [{"camera_type": "kb4", "intrinsics": numbers}]}}
    assert load_camera(written(json.dumps(tree)), size=SIZE) == FISHEYE
    with pytest.raises(BadInput, match="does not say the size"):
        load_camera(written(json.dumps(tree)))


NAMES, VALUES = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"), [*map(str, (*FOCAL, *LENS, 0.05))]


@pytest.mark.parametrize(
    "text",
    [
        *("\n".join(map(between.join, zip(NAMES, VALUES, strict=True))) for between in (" ", "=", " = ", ": ", "\t")),
        *(between.join(NAMES) + "\n" + between.join(VALUES) for between in ", "),
        "250.5 0 170.25\n0 251.5 131.75\n0 0 1\n-0.3 0.12 0.001 -0.002 0.05\n",
    ],
)
def test_numbers_beside_their_names_and_below_a_matrix(written, text):
    assert load_camera(written(text), size=SIZE) == THREE


def test_numbers_beside_other_names_are_refused(written):
    for text in ("fx 250 fy 250 cx 170 cy 130 skew 0", "fx 250 fy 250 cx 170", "fx 1 fx 2 fy 3 cx 4 cy 5"):
        with pytest.raises(BadFile):
            load_camera(written(text), size=SIZE)


@pytest.mark.parametrize(
    ("topic", "focal"), [("davis/left/events", 100), ("davis/right/events", 101), ("right/events", 101)]
)
def test_the_camera_of_a_file_of_several_goes_with_the_name_of_its_events(written, topic, focal):
    lens = "  camera_model: pinhole\n  distortion_model: none\n  resolution: [64, 48]\n"
    sides = "".join(
        f"{side}:\n  intrinsics: [{100 + number}, 100, 31, 23]\n{lens}  rostopic: /davis/{side}/image_raw\n"
        for number, side in enumerate(("left", "right"))
    )
    assert load_camera(written(sides), topic=topic).fx == focal
