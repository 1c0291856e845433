"""Wrong arguments of public functions are an error that says how, whatever their type."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import evimo
import evimo.samples
from evimo.arguments import MOST_PIXELS, number_of, path_of, paths_of, size_of, word_of
from evimo.errors import BadInput, EvimoError, NotFound

SAMPLE = evimo.samples.path()
ROWS = np.stack((np.arange(0, 60_000, 10), *np.indices((60, 100)).reshape(2, -1), np.arange(6000) % 2), axis=1)
WITHOUT_SIZE = "170 170 119.5 89.5 0 0 0 0"


@pytest.mark.parametrize("given", ["a/b.bag", Path("a/b.bag")])
def test_a_path_is_a_word_or_a_path(given):
    assert path_of(given, "a recording") == Path("a/b.bag")
    assert paths_of(given, "a recording") == [Path("a/b.bag")]
    assert paths_of(iter([given, "c"]), "a recording") == [Path("a/b.bag"), Path("c")]


@pytest.mark.parametrize(
    ("given", "said"), [(None, "nothing"), (3, "type int"), (b"a", "type bytes"), (ROWS, "ndarray")]
)
def test_what_is_no_path_is_named(given, said):
    with pytest.raises(BadInput, match=f"a recording is given as .*{said}"):
        path_of(given, "a recording")


def test_a_path_that_the_system_refuses_is_not_found():
    with pytest.raises(NotFound, match="a recording cannot be looked for: File name too long"):
        path_of("a" * 5000, "a recording")


@pytest.mark.parametrize("given", [(260, 346), [260, 346], np.array([260, 346]), (260.0, np.float32(346))])
def test_two_whole_numbers_are_a_size(given):
    size = size_of(given, "sensor")
    assert size == (260, 346)
    assert [type(each) for each in size] == [int, int]


@pytest.mark.parametrize(
    "given",
    [
        *("346x260", "12", b"12", 260, None, (260,), (260, 346, 1), (260, "wide"), [], ()),
        *((0, 346), (-260, 346), (260.5, 346), (260, np.nan), (260, np.inf), (MOST_PIXELS, 2)),
        *((10**400, 2), np.zeros((2, 2))),
    ],
)
def test_what_is_no_size_of_a_sensor_is_refused(given):
    with pytest.raises(BadInput, match=r"sensor is .*\n  try: \(height, width\)"):
        size_of(given, "sensor")


def test_numbers_and_words():
    assert number_of(np.float32(0.5), "start", fix="") == 0.5
    assert word_of("left", "topic", fix="") == "left"
    with pytest.raises(BadInput, match=r"start is \[1, 2\], which is no number"):
        number_of([1, 2], "start", fix="")
    with pytest.raises(BadInput, match="start is a value of type int, which is no number"):
        number_of(10**400, "start", fix="")
    with pytest.raises(BadInput, match="topic is a value of type ndarray, which is no word"):
        word_of(np.arange(1000), "topic", fix="")


def first(events, **options):
    return next(iter(evimo.run(events, **{"model": "tiny"} | options)))


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda at: first(ROWS, sensor="173x130"), "sensor is '173x130'"),
        (lambda at: first(ROWS, sensor=(50, 50)), "events reach column 59 and row 99, beyond a sensor of 50x50"),
        (lambda at: first(ROWS, sensor=(60, 100)), r"beyond a sensor of 100x60\n.*; sizes are \(height, width\)"),
        (lambda at: first(SAMPLE, sensor=260), "sensor is 260"),
        (lambda at: first(evimo.open_events(SAMPLE), sensor=(10, 10)), "was opened with a sensor of 240x180"),
        (lambda at: first(ROWS.tolist()), "list holds no events"),
        (lambda at: first(3), "int holds no events"),
        (lambda at: first("a" * 5000), "File name too long"),
        (lambda at: first(SAMPLE, model=None), r"a model is given as nothing \(None\)"),
        (lambda at: first(SAMPLE, model=3), "a model is given as a value of type int"),
        (lambda at: first(SAMPLE, camera=np.eye(3)), "a camera is given as a value of type ndarray"),
        (lambda at: first(SAMPLE, camera=(130, 130, 86, 64)), r"type tuple\n.*evimo.Camera\(fx=…"),
        (lambda at: first(SAMPLE, start_s=None), "the start is None, which is no number"),
        (lambda at: first(SAMPLE, stop_s="soon"), "the stop is 'soon', which is no number"),
        (lambda at: evimo.open_events(None), "a recording is given as nothing"),
        (lambda at: evimo.open_events(ROWS), "a recording is given as a value of type ndarray"),
        (lambda at: evimo.open_events(at, sensor=(0, 0)), r"sensor is \(0, 0\)"),
        (lambda at: evimo.open_events(at, time_unit="sec"), r"times in 'sec'\n.*s, ms, us, ns"),
        (lambda at: evimo.open_events(at, time_unit=[]), r"times in \[\]"),
        (lambda at: evimo.open_events(at, columns=["t", "x"]), r"columns is \['t', 'x'\]"),
        (lambda at: evimo.open_events(at, topic=3), "topic is 3"),
        (lambda at: evimo.open_recording([at]), "a recording is given as a value of type list"),
        (lambda at: evimo.evaluate(None), "a recording is given as nothing"),
        (lambda at: evimo.evaluate([ROWS]), "a recording is given as a value of type ndarray"),
        (lambda at: evimo.evaluate(at, out=3), "out is given as a value of type int"),
        (lambda at: evimo.evaluate(at, density_threshold="x"), "density_threshold is 'x'"),
        (lambda at: evimo.evaluate_predictions(ROWS, at), "no recording with truth"),
        (lambda at: evimo.evaluate_predictions(at, 3), "a recording is given as a value of type int"),
    ],
)
def test_a_wrong_argument_is_one_error_with_a_fix(call, said, tmp_path):
    path = tmp_path / "numbers.txt"
    path.write_text(WITHOUT_SIZE)
    with pytest.raises(EvimoError, match=said):
        call(path)


SEEN_BY_TYPE_CHECKERS = {  # of shapes, which look at geometry and models before we do while tests run
    "evimo.load_camera(np.eye(3))": "a calibration is given as a value of type ndarray",
    "evimo.load_camera('calib.txt', size='240x180')": "size is '240x180', which is no size",
    "evimo.load_camera('calib.txt', size=(180, 240), camera=3)": "camera is 3, which is no word",
    "evimo.load_camera('calib.txt', size=(180, 240), topic=3)": "topic is 3, which is no word",
    "evimo.load_camera('calib.txt', size=np.array([180, 240])).size": "(180, 240)",
    "evimo.Camera(None, 1, 1, 1, 1, 1)": "fx of the camera is None, which is no number",
    "evimo.Camera(1, 1, 1, 1, 10.5, 3)": "the size of the camera's sensor is (10.5, 3), which is no size",
    "evimo.Camera(1, 1, 1, 1, 10**9, 3)": "the size of the camera's sensor is (1000000000, 3), which is no size",
    "evimo.Camera(1, 1, 1, 1, 1, 1, None)": "not coefficients of a lens: None",
    "evimo.Camera(np.float32(1), 1, 1, 1, 4.0, 5, np.zeros(4)).distortion": "(0.0, 0.0, 0.0, 0.0)",
    "evimo.Camera(np.float32(1), 1, 1, 1, 4.0, np.int64(5)).size": "(4, 5)",
    "evimo.load_model(3)": "a model is given as a value of type int",
    "evimo.load_model('tiny', device='gpu0')": "no device 'gpu0' for a model: Invalid device string: 'gpu0'",
}


def test_wrong_cameras_and_models_are_one_error_each(tmp_path):
    (tmp_path / "calib.txt").write_text(WITHOUT_SIZE)
    program = f"""
import numpy as np, evimo
from evimo.errors import EvimoError
for call in {list(SEEN_BY_TYPE_CHECKERS)}:
    try:
        print(eval(call))
    except EvimoError as error:
        print(error.problem)
"""
    ran = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True)
    assert ran.stdout.splitlines() == list(SEEN_BY_TYPE_CHECKERS.values()), ran.stderr
