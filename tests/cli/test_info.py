import numpy as np
import pytest

from evimo.cli.info import info
from evimo.cli.reading import Reading
from evimo.errors import BadFile, BadInput


@pytest.fixture
def recording(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("100 5 6 1\n300 7 8 0\n200 7 8 0\n1000100 63 47 1\n")
    return path


@pytest.mark.filterwarnings("ignore::evimo.errors.EvimoWarning")
def test_info_prints_what_is_inside(recording, capsys):
    info(recording, reading=Reading(sensor="64x48"))
    printed = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert printed["format"] == "text (times in µs, guessed)"
    assert printed["sensor"] == "64x48"
    assert printed["span"] == "1.000001 s"
    assert printed["events"] == "4"
    assert printed["polarity"] == "50.0% on, 50.0% off"
    assert printed["timestamps"] == "not sorted; 1 events were out of order and sorted"


def test_info_tells_camera_maps_and_meta(tmp_path, capsys):
    np.savez(
        tmp_path / "a.npz",
        events=np.array([[0.0, 5, 6, 1], [0.5, 7, 8, 0]]),
        depth=np.zeros((2, 48, 64)),
        K=np.array([[50.0, 0, 31], [0, 51, 23], [0, 0, 1]]),
        meta=np.array({"poses": []}, dtype=object),
    )
    info(tmp_path / "a.npz")
    out = capsys.readouterr().out
    assert "timestamps   sorted\n" in out
    assert "fx 50.00 fy 51.00 cx 31.00 cy 23.00" in out
    assert "depth maps   2\n" in out and "not opened" in out


def test_info_of_bad_input_is_an_error_of_ours(recording, tmp_path):
    with pytest.raises(BadInput, match="346x260"):
        info(recording, reading=Reading(sensor="big"))
    (tmp_path / "empty.es").write_bytes(b"")
    with pytest.raises(BadFile, match="empty"):
        info(tmp_path / "empty.es")


@pytest.mark.filterwarnings("ignore::evimo.errors.EvimoWarning")
def test_info_tells_the_gyroscope(recording, tmp_path, capsys):
    info(recording, reading=Reading(sensor="64x48"))
    assert "gyroscope    none\n" in capsys.readouterr().out
    t_us = 500 * np.arange(1000)
    rows = np.array([[0.0, 5, 6, 1], [0.5, 7, 8, 0]])
    np.savez(tmp_path / "a.npz", events=rows, sim_imu_t_us=t_us, sim_imu_gyro=np.zeros((1000, 3), np.float32))
    info(tmp_path / "a.npz", reading=Reading(sensor="64x48"))
    assert "gyroscope    1,000 samples, 2,000 Hz, in camera axes (a.npz, simulated)" in capsys.readouterr().out
