"""Calibrations as other programs write them: OpenCV and dv-processing by their own libraries, others by layout."""

import json

import cv2
import dv_processing
import numpy as np
import pytest

from evimo.errors import BadFile, BadInput, NotFound
from evimo.geometry.calibration import load_camera, nearest
from evimo.geometry.camera import Camera

MATRIX = np.array([[1000.5, 0, 640.25], [0, 1001.5, 360.75], [0, 0, 1]])
BENT = (-0.1, 0.2, 0.001, -0.002, 0.05)
HD = Camera(1000.5, 1001.5, 640.25, 360.75, 720, 1280, BENT)


@pytest.fixture
def written(tmp_path):
    def write(text, name="calibration.txt"):
        path = tmp_path / name
        path.write_text(text) if isinstance(text, str) else path.write_bytes(text)
        return path

    return write


def opencv_file(path, distortion=BENT, **more):
    """What cv::FileStorage writes for a calibration; its sizes and lens by the names in `more`."""
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in more.items():
        if isinstance(value, tuple):
            storage.startWriteStruct(name, cv2.FileNode_SEQ | cv2.FileNode_FLOW)
            for each in value:
                storage.write("", each)
            storage.endWriteStruct()
        else:
            storage.write(name, value)
    storage.write("camera_matrix", MATRIX)
    storage.write("distortion_coefficients", np.array(distortion)[:, None])
    storage.release()
    return path


@pytest.mark.parametrize("suffix", ["yml", "xml", "json"])
def test_opencv(tmp_path, suffix):
    path = opencv_file(tmp_path / f"a.{suffix}", image_width=1280, image_height=720)
    assert load_camera(path) == HD
    unsized = opencv_file(tmp_path / f"b.{suffix}")
    assert load_camera(unsized, size=(720, 1280)) == HD
    with pytest.raises(BadInput, match="does not say the size"):
        load_camera(unsized)
    with pytest.raises(BadInput, match=r"centre 640\.25, 360\.75 is not on a sensor of 346x260"):
        load_camera(unsized, size=(260, 346))
    fisheye = opencv_file(tmp_path / f"c.{suffix}", BENT[:4], image_width=1280, image_height=720, fisheye_model=1)
    assert load_camera(fisheye) == Camera(1000.5, 1001.5, 640.25, 360.75, 720, 1280, BENT[:4], "fisheye")


@pytest.mark.parametrize("suffix", ["yml", "xml", "json"])
def test_metavision_writes_with_opencv(tmp_path, suffix):
    """metavision_mono_calibration: five coefficients of a pinhole; four are a fisheye's, which it does not name."""
    path = opencv_file(tmp_path / f"a.{suffix}", n_kept_views=12, image_size=(1280, 720))
    assert load_camera(path) == HD
    path = opencv_file(tmp_path / f"b.{suffix}", BENT[:4], n_kept_views=12, image_size=(1280, 720))
    assert load_camera(path).lens == "fisheye"


def test_zeros_beyond_five_coefficients_are_none(tmp_path):
    path = opencv_file(tmp_path / "a.yml", (*BENT, 0, 0, 0), image_width=1280, image_height=720)
    assert load_camera(path) == HD
    path = opencv_file(tmp_path / "b.yml", (*BENT, 0.1, 0, 0), image_width=1280, image_height=720)
    with pytest.raises(BadFile, match=r"b\.yml, camera: a radtan lens with 8 coefficients"):
        load_camera(path)


def test_opencv_stereo(tmp_path):
    storage = cv2.FileStorage(str(tmp_path / "intrinsics.yml"), cv2.FILE_STORAGE_WRITE)
    for number, scale in ((1, 1.0), (2, 1.1)):
        storage.write(f"M{number}", MATRIX * [[scale], [scale], [1]])
        storage.write(f"D{number}", np.array([BENT]))
    storage.release()
    assert load_camera(tmp_path / "intrinsics.yml", size=(720, 1280), camera="cam0") == HD
    assert load_camera(tmp_path / "intrinsics.yml", size=(720, 1280), camera="cam1").fx == pytest.approx(1100.55)


@pytest.fixture
def dv_set(tmp_path):
    """Two cameras, written by iniVation's own library; it keeps float32."""
    camera = dv_processing.camera
    stay = dv_processing.kinematics.Transformationf(0, np.eye(4, dtype=np.float32))
    made = camera.CalibrationSet()
    rows = [
        ("DVXplorer_DXA00080", "left", (640, 480), camera.DistortionModel.RADIAL_TANGENTIAL, [-0.5, 0.25, 0, 0.125, 0]),
        ("DVXplorer_DXA00081", "right", (640, 480), camera.DistortionModel.EQUIDISTANT, [0.5, 0.25, 0.125, 0]),
    ]
    for name, side, size, model, distortion in rows:
        place = (name, side, side == "left", size, (size[0] / 2 + 1, size[1] / 2), (250.5, 251.5))
        made.addCameraCalibration(camera.calibrations.CameraCalibration(*place, distortion, model, stay, None))
    made.writeToFile(str(tmp_path / "set.json"))
    return tmp_path / "set.json"


def test_dv_processing(dv_set):
    left = Camera(250.5, 251.5, 321.0, 240.0, 480, 640, (-0.5, 0.25, 0.0, 0.125, 0.0))
    right = Camera(250.5, 251.5, 321.0, 240.0, 480, 640, (0.5, 0.25, 0.125, 0.0), "fisheye")
    for name, expected in (("left", left), ("dvxplorer_dxa00080", left), ("C0", left), ("right", right), ("C1", right)):
        assert load_camera(dv_set, size=(480, 640), camera=name) == expected
    with pytest.raises(BadInput, match=r"2 of its cameras fit: C0 \(DVXplorer_DXA00080, left\), C1 \(DVXplorer"):
        load_camera(dv_set, size=(480, 640))
    with pytest.raises(NotFound, match=r"no camera 'top' in it\n  try: one of: C0 \(DVX"):
        load_camera(dv_set, camera="top")


DSEC_CAMERA = """\
  {name}:
    camera_model: pinhole
    camera_matrix: [{focal}, 553, 346, 216]
"""
LENS = "    distortion_model: radtan\n    distortion_coeffs: [-0.09, 0.19, 0, 0]\n"


def dsec(*names):
    """As cam_to_cam.yaml: intrinsics of four cameras and of their rectified twins, then extrinsics."""
    text = "intrinsics:\n"
    for number, name in enumerate(names):
        size = "[1440, 1080]" if name[-1] in "12" else "[640, 480]"
        text += DSEC_CAMERA.format(name=name, focal=500 + number) + ("" if "Rect" in name else LENS)
        text += f"    resolution: {size}\n"
    return text + "extrinsics:\n  T_10:\n    - [1, 0, 0, 0]\n    - [0, 1, 0, 0]\n"


def test_dsec_gives_the_camera_as_it_saw(written):
    path = written(dsec("cam0", "cam1", "camRect0", "camRect1"))
    seen = load_camera(path, size=(480, 640))
    assert seen == Camera(500.0, 553.0, 346.0, 216.0, 480, 640, (-0.09, 0.19, 0.0, 0.0))
    assert load_camera(path, size=(480, 640), camera="camRect0") == Camera(502.0, 553.0, 346.0, 216.0, 480, 640)
    assert load_camera(written(dsec("camRect0")), size=(480, 640)).is_pinhole
    whole = written(dsec(*(f"cam{rect}{n}" for rect in ("", "Rect") for n in range(4))))
    with pytest.raises(BadInput, match="2 of its cameras fit: cam0, cam3"):
        load_camera(whole, size=(480, 640))
    assert load_camera(whole, size=(480, 640), camera="cam3").fx == 503


ROS1_ECHO = """\
header:
  seq: 1
  stamp:
    secs: 1
    nsecs: 0
  frame_id: "cam"
height: 180
width: 240
distortion_model: "plumb_bob"
D: [-0.1, 0.2, 0.001, -0.002, 0.05]
K: [200.5, 0.0, 120.0, 0.0, 201.5, 90.0, 0.0, 0.0, 1.0]
R: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
P: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
binning_x: 0
roi:
  x_offset: 0
  height: 0
  width: 0
  do_rectify: False
---
"""


def ros2_echo():
    lists = {"d": BENT, "k": (200.5, 0.0, 120.0, 0.0, 201.5, 90.0, 0.0, 0.0, 1.0)}
    text = ROS1_ECHO.replace("D: ", "# ").replace("K: ", "# ").split("binning")[0]
    return (
        text + "".join(f"{name}:\n" + "".join(f"- {each}\n" for each in row) for name, row in lists.items()) + "---\n"
    )


@pytest.mark.parametrize(
    "text", [ROS1_ECHO, ROS1_ECHO * 3, ROS1_ECHO + ROS1_ECHO[:150], "---\n" + ROS1_ECHO, ros2_echo()]
)
def test_what_rostopic_echo_prints(written, text):
    """One message or many, the last one broken off, by ROS 1 and ROS 2."""
    assert load_camera(written(text)) == Camera(200.5, 201.5, 120.0, 90.0, 180, 240, BENT)


def test_rostopic_echo_of_a_camera_that_nobody_calibrated(written):
    with pytest.raises(BadFile, match="positive focal lengths"):
        load_camera(written(ROS1_ECHO.replace("200.5", "0.0").replace("201.5", "0.0")))


RPG = "199.092366542 198.82882047 132.192071378 110.712660011 -0.368436311798 0.150947243557 -0.0002961 -0.0007594 0.0"


def test_the_numbers_of_the_rpg_datasets(written):
    numbers = tuple(map(float, RPG.split()))
    expected = Camera(*numbers[:4], 180, 240, numbers[4:])
    for text in (RPG, RPG + "\n", RPG.replace(" ", "\n"), RPG.replace(" ", ", ")):
        assert load_camera(written(text), size=(180, 240)) == expected
    with pytest.raises(BadInput, match="size of its sensor"):
        load_camera(written(RPG))
    with pytest.raises(BadInput, match="not on a sensor of 128x128"):
        load_camera(written(RPG), size=(128, 128))


def test_a_matrix_as_numpy_prints_it_is_told_from_the_nine_numbers(tmp_path):
    np.savetxt(tmp_path / "K.txt", MATRIX)
    assert load_camera(tmp_path / "K.txt", size=(720, 1280)) == Camera(1000.5, 1001.5, 640.25, 360.75, 720, 1280)
    np.savetxt(tmp_path / "four.txt", [1000.5, 1001.5, 640.25, 360.75])
    assert load_camera(tmp_path / "four.txt", size=(720, 1280)).is_pinhole


def basalt(*kinds):
    """As TUM-VIE's calibration: two frame cameras, then two event cameras."""
    inner = {"fx": 749.5, "fy": 750.5, "cx": 511.0, "cy": 509.0, "k1": -0.01, "k2": 0.02, "k3": -0.03, "k4": 0.04}
    cameras = [{"camera_type": kind, "intrinsics": inner | {"fx": 749.5 + n}} for n, kind in enumerate(kinds)]
    sizes = [[1024, 1024], [1024, 1024], [1280, 720], [1280, 720]][: len(kinds)]
    return json.dumps({"value0": {"T_imu_cam": [{"px": 0.1}] * len(kinds), "intrinsics": cameras, "resolution": sizes}})


def test_tum_vie(written):
    path = written(basalt(*["kb4"] * 4), "calibration.json")
    expected = Camera(752.5, 750.5, 511.0, 509.0, 720, 1280, (-0.01, 0.02, -0.03, 0.04), "fisheye")
    assert load_camera(path, camera="cam3") == expected
    with pytest.raises(BadInput, match="2 of its cameras fit: cam2, cam3"):
        load_camera(path, size=(720, 1280))
    assert load_camera(written(basalt("kb4", "kb4", "kb4")), size=(720, 1280)).fx == 751.5
    assert load_camera(written(basalt("kb4", "kb4", "pinhole")), size=(720, 1280)).is_pinhole
    with pytest.raises(BadFile, match="cam2: unknown lens model 'ds'"):
        load_camera(written(basalt("kb4", "kb4", "ds")), size=(720, 1280))


def chain(*topics, sizes=(240, 240), models=("pinhole", "pinhole")):
    return "".join(
        f"left{number}:\n  camera_model: {model}\n  intrinsics: [{100 + number}, 100, 100, 90]\n"
        f"  resolution: [{width}, 180]\n  rostopic: {topic}\n"
        for number, (topic, width, model) in enumerate(zip(topics, sizes, models, strict=True))
    )


@pytest.mark.parametrize(
    "topic, focal",
    [
        ("/davis/left/events", 100),
        ("/davis/right/events", 101),
        ("davis/right/camera/events", 101),
        ("/left1/events", 101),
        ("/davis/events", None),
        ("/other/events", None),
        ("", None),
    ],
)
def test_the_camera_of_a_topic(written, topic, focal):
    path = written(chain("/davis/left/image_raw", "/davis/right/image_raw"))
    if focal is None:
        with pytest.raises(BadInput, match="2 of its cameras fit"):
            load_camera(path, size=(180, 240), topic=topic)
    else:
        assert load_camera(path, size=(180, 240), topic=topic).fx == focal


def test_the_size_goes_before_the_topic_and_a_name_before_both(written):
    path = written(chain("/davis/left/image_raw", "/davis/right/image_raw", sizes=(240, 346)))
    assert load_camera(path, size=(180, 240), topic="/davis/right/events").fx == 100
    assert load_camera(path, topic="/davis/left/events", camera="left1").fx == 101
    with pytest.raises(BadInput, match="calibrated for 346x180, but the sensor is 240x180"):
        load_camera(path, size=(180, 240), camera="left1")
    with pytest.raises(BadFile, match="left1: unknown lens model 'omni'"):
        load_camera(written(chain("/a/b", "/c/d", models=("pinhole", "omni"))), size=(180, 240), camera="left1")


def test_a_camera_of_another_kind_does_not_stand_in_the_way(written):
    text = chain("/a/b", "/c/d", sizes=(640, 240), models=("omni", "pinhole"))
    assert load_camera(written(text), size=(180, 240)).fx == 101


def test_cameras_that_are_the_same_need_no_choice(written):
    text = chain("/a/b", "/c/d").replace("[101,", "[100,")
    assert load_camera(written(text), size=(180, 240)).fx == 100


def test_nearest_counts_words_from_the_front():
    others = {"one": "/a/b/image", "two": "/a/c/image", "three": "/d"}
    assert nearest("/a/b/events", others) == ["one"]
    assert nearest("/a/events", others) == ["one", "two"]
    assert nearest("/d/events", others) == []


TWO_BOMBS = "".join(
    f"{name}0: &{name}0 [x]\n"
    + "".join(f"{name}{n}: &{name}{n} [{', '.join([f'*{name}{n - 1}'] * 9)}]\n" for n in range(1, 10))
    for name in "ab"
)
NESTED_MAPS = "m0: &m0 {x: 1}\n" + "".join(f"m{n}: &m{n} {{a: *m{n - 1}, b: *m{n - 1}}}\n" for n in range(1, 24))


@pytest.mark.parametrize(
    "text",
    [
        TWO_BOMBS + chain("/a", "/b").replace("[100,", "*a9 #").replace("[101,", "*b9 #"),
        NESTED_MAPS,
        NESTED_MAPS + "intrinsics: *m23\n",
        basalt("kb4").replace('"fx": 749.5', '"fx": [[1]]'),
        basalt("kb4").replace("[1024, 1024]", "7"),
        basalt("kb4").replace('{"camera_type"', '[7, {"camera_type"', 1),
        '{"camera_matrix": [[1, 2], {"a": 3}], "image_width": 1, "image_height": 1}',
        '{"camera_matrix": {"data": {"data": 1}}, "width": 1e999, "height": 1}',
        '{"fx": 1, "fy": {}, "cx": null, "cy": true, "width": 10, "height": 10}',
        "[" * 100_000,
        '{"a":' * 20_000,
    ],
)
def test_what_strangers_wrote_ends_in_one_error(written, text):
    with pytest.raises((BadFile, BadInput)) as error:
        load_camera(written(text), size=(180, 240))
    assert len(str(error.value)) < 700


BENT4 = BENT[:4]
NAMED = {"fx": 1000.5, "fy": 1001.5, "cx": 640.25, "cy": 360.75}
LENS4 = dict(zip(("k1", "k2", "p1", "p2"), BENT4, strict=True))
SIZE = {"width": 1280, "height": 720}
ROWS = {"camera_matrix": MATRIX.tolist(), "image_size": [1280, 720]}
HD4 = Camera(1000.5, 1001.5, 640.25, 360.75, 720, 1280, BENT4)


@pytest.mark.parametrize(
    "tree, expected",
    [
        (NAMED | LENS4 | SIZE, HD4),
        (NAMED | LENS4 | SIZE | {"k3": 0.05}, HD),
        (
            NAMED | SIZE | {"k1": 0.1, "k2": 0.2, "k3": 0.3},
            Camera(*NAMED.values(), 720, 1280, (0.1, 0.2, 0.0, 0.0, 0.3)),
        ),
        ({"intrinsics": NAMED, "distortion": LENS4} | SIZE, HD4),
        (ROWS | {"dist": [BENT]}, HD),
        ({"mtx": MATRIX.tolist(), "dist": [BENT], "imageSize": [1280, 720]}, HD),
        (ROWS | {"dist": BENT, "image_size": SIZE}, HD),
        (ROWS | {"dist": BENT, "distortion_model": ""}, HD),
        (ROWS | {"dist": BENT, "distances": [0.5, 1.0]}, HD),
        (ROWS | {"distances": [0.5, 1.0]}, Camera(*NAMED.values(), 720, 1280)),
        (ROWS | {"dist": BENT4, "fisheye_model": "True"}, Camera(*NAMED.values(), 720, 1280, BENT4, "fisheye")),
        (
            NAMED | SIZE | {"k1": 0.1, "k2": 0.2, "k3": 0.3, "k4": 0.4, "distortion_model": "fisheye"},
            Camera(*NAMED.values(), 720, 1280, (0.1, 0.2, 0.3, 0.4), "fisheye"),
        ),
        (  # VINS, camodocal
            {"model_type": "PINHOLE", "image_width": 1280, "image_height": 720}
            | {"distortion_parameters": LENS4, "projection_parameters": NAMED},
            HD4,
        ),
    ],
)
def test_lenses_by_other_names_are_not_left_out(written, tree, expected):
    assert load_camera(written(json.dumps(tree))) == expected


@pytest.mark.parametrize(
    "tree, words",
    [
        (ROWS | {"dist_coeff": BENT}, "its 'dist_coeff' is not understood"),
        (ROWS | {"distortionParams": {"a": 1}}, "its 'distortionParams' is not understood"),
        (ROWS | {"dist": BENT4, "distortion_model": "none"}, r"no lens \(none\), but 4 coefficients"),
        (ROWS | {"distortion_model": "equidistant"}, "its lens, equidistant, has no coefficients"),
        (NAMED | SIZE | {"k1": 0.1, "k2": 0.2, "k3": 0.3, "k4": 0.4}, "without the name of their lens"),
        (NAMED | LENS4 | SIZE | {"k3": 0.1, "k4": 0.1, "k5": 0, "k6": 0}, "a radtan lens with 8 coefficients"),
        (NAMED | LENS4 | SIZE | {"cx": 1300}, r"centre 1300, 360\.75 is not on a sensor of 1280x720"),
        (NAMED | SIZE | {"cy": -1}, "is not on a sensor"),
        (NAMED | SIZE | {"fx": 8, "fy": 8}, r"focal lengths of 8 and 8 px are impossible .*\n.*in px"),
        (NAMED | SIZE | {"fx": 1e9}, "are impossible on a sensor of 1280x720"),
        (
            {"model_type": "MEI", "projection_parameters": {"gamma1": 1, "gamma2": 1, "u0": 1, "v0": 1}} | SIZE,
            "unknown lens model 'MEI'",
        ),
    ],
)
def test_lenses_and_numbers_that_cannot_be_are_named(written, tree, words):
    with pytest.raises((BadFile, BadInput), match=words):
        load_camera(written(json.dumps(tree)))


def test_numbers_with_comments_and_brackets(written):
    numbers = tuple(map(float, RPG.split()))
    expected = Camera(*numbers[:4], 180, 240, numbers[4:])
    for text in ("# fx fy cx cy k1 k2 p1 p2 k3\n" + RPG, f"[{RPG.replace(' ', ', ')}]", "% of the left\n" + RPG):
        assert load_camera(written(text), size=(180, 240)) == expected
    assert load_camera(written(str(MATRIX)), size=(720, 1280)) == Camera(*NAMED.values(), 720, 1280)
    nearly = np.where(MATRIX == 0, 1e-13, MATRIX)
    nearly[2] = 0, 0, 1
    tree = {"camera_matrix": nearly.tolist(), "image_size": [1280, 720]}
    assert load_camera(written(json.dumps(tree))) == Camera(*NAMED.values(), 720, 1280)


def test_a_camera_is_named_by_its_topic_too(written):
    path = written(chain("/davis/left/image_raw", "/davis/right/image_raw"))
    assert load_camera(path, camera="/davis/right/image_raw").fx == 101


@pytest.mark.parametrize(
    "text, words",
    [
        (
            "version https://git-lfs.github.com/spec/v1\noid sha256:ab\nsize 1\n",
            "a git-lfs pointer, .*\n.*git lfs pull",
        ),
        ("\n<!DOCTYPE html>\n<html><body>Sign in</body></html>", r"a web page \(HTML\), not the file itself"),
    ],
)
def test_what_lies_in_place_of_a_calibration_is_called_that(written, text, words):
    with pytest.raises(BadFile, match=words):
        load_camera(written(text))
