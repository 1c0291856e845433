import csv
import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import av
import h5py
import numpy as np
import pytest

from evimo.cli import main
from evimo.writing import MARKER

ALL = {"egomotion.csv", "objects.csv", "summary.json", "estimates.h5", "video.mp4"}


def names_in(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def warnings_in(errors: str) -> list[str]:
    """All lines but those of progress, which come on a slow machine."""
    return [line for line in errors.splitlines() if " slices/s, " not in line]


def test_the_classical_method_leaves_the_same_files_without_weights(recording, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("evimo.streaming.inference.presets", dict)
    out = tmp_path / "out"
    asked = ["--model", "classical", "--sensor", "32x24", "--event-labels", "--out", str(out)]
    assert main(["run", str(recording), *asked]) == 0
    assert names_in(out) == ALL | {"events.h5"}
    model = json.loads((out / "summary.json").read_text())["model"]
    assert model["name"] == "classical" and "sha256" not in model
    assert "threshold 1.8" in model["parameters"] and model["config"]["threshold"] == 1.8
    with h5py.File(out / "estimates.h5") as saved:
        assert saved.attrs["model"] == "classical"
        assert saved.attrs["model_parameters"] == model["parameters"]
        assert "model_sha256" not in saved.attrs


def test_a_recording_becomes_video_tables_and_maps(recording, fake_network, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["run", str(recording), "--model", str(fake_network), "--sensor", "32x24", "--out", str(out)]) == 0
    assert names_in(out) == ALL
    said = capsys.readouterr()
    assert said.out.startswith("20 slices at ")
    assert all(str(out / name) in said.out for name in ALL)
    assert "1 moving object seen" in said.out
    warned = warnings_in(said.err)
    assert [line[:24] for line in warned] == ["warning: no calibration:"]
    summary = json.loads((out / "summary.json").read_text())
    assert summary["settings"] == {
        "dense": True,
        "video_speed": 0.25,
        "start_s": 0.0,
        "stop_s": None,
        "event_labels": False,
        "imu": "auto",
        "calibration": None,
        "camera": None,
        "sensor": "32x24",
        "time_unit": None,
        "columns": None,
        "topic": None,
    }
    assert [f"warning: {text}" for text in summary["warnings"]] == warned


def test_event_labels_are_a_file_of_their_own(recording, fake_network, tmp_path):
    arguments = ["--sensor", "32x24", "--no-video", "--no-dense", "--event-labels", "--out", str(tmp_path / "o")]
    assert main(["run", str(recording), "--model", str(fake_network), *arguments]) == 0
    assert names_in(tmp_path / "o") == ALL - {"video.mp4", "estimates.h5"} | {"events.h5"}
    with h5py.File(tmp_path / "o" / "events.h5") as saved:
        t_us = np.loadtxt(recording, dtype=np.int64)[:, 0]
        assert saved["t_us"][:].tolist() == t_us[t_us < t_us[-1] // 25_000 * 25_000].tolist()
        in_table = {int(row["object"]) for row in csv.DictReader((tmp_path / "o" / "objects.csv").open())}
        assert set(saved["object"][:].tolist()) - {0} == in_table != set()
    assert json.loads((tmp_path / "o" / "summary.json").read_text())["settings"]["event_labels"] is True


def test_the_folder_is_named_after_the_recording(recording, fake_network, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments = ["--model", str(fake_network), "--no-video", "--no-dense", "--start", "0.2", "--stop", "0.4"]
    assert main(["run", str(recording), *arguments]) == 0
    assert names_in(tmp_path / "out" / "square") == ALL - {"video.mp4", "estimates.h5"}
    assert json.loads((tmp_path / "out" / "square" / "summary.json").read_text())["slices"] == 8


def test_a_guessed_sensor_and_camera_are_one_warning_each(recording, fake_network, tmp_path, capsys):
    assert main(["run", str(recording), "--model", str(fake_network), "--no-video", "--out", str(tmp_path / "o")]) == 0
    assert len(warnings_in(capsys.readouterr().err)) == 2


def test_a_calibration_is_used(recording, fake_network, tmp_path, capsys):
    (tmp_path / "calib.txt").write_text("20 21 15.5 11.5 0 0 0 0\n")
    arguments = ["--sensor", "32x24", "--calibration", str(tmp_path / "calib.txt"), "--no-video"]
    assert main(["run", str(recording), "--model", str(fake_network), "--out", str(tmp_path / "o"), *arguments]) == 0
    camera = json.loads((tmp_path / "o" / "summary.json").read_text())["camera"]
    assert (camera["fx"], camera["fy"], camera["source"]) == (20, 21, "given")
    assert not warnings_in(capsys.readouterr().err)


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["nowhere.aedat4"], "nowhere.aedat4"),
        (["RECORDING", "--model", "enormous"], "no model 'enormous'"),
        (["RECORDING", "--model", "RECORDING"], "not an ONNX model"),
        (["RECORDING", "--calibration", "nowhere.yaml"], "nowhere.yaml"),
        (["RECORDING", "--sensor", "large"], "'large' is not a sensor size"),
        (["RECORDING", "--start", "7"], "no part of a recording of"),
        (["RECORDING", "--stop", "0.01"], "no complete slice"),
        (["RECORDING", "--video-speed", "0"], "a video 0 times as fast"),
        (["MODEL"], "MODEL"),
        (["RECORDING", "--out", "RECORDING"], "cannot write"),
    ],
)
def test_bad_input_is_one_clear_error(recording, fake_network, tmp_path, monkeypatch, capsys, arguments, problem):
    monkeypatch.chdir(tmp_path)
    names = {"RECORDING": str(recording), "MODEL": str(fake_network)}
    model = [] if "--model" in arguments else ["--model", str(fake_network)]
    before = sorted(tmp_path.rglob("*"))
    assert main(["run", *(names.get(argument, argument) for argument in arguments), *model]) == 2
    said = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("warning: ")]
    assert len(said) == 2
    assert said[0].startswith("error: ")
    assert Path(names.get(problem, problem)).name in said[0]
    assert said[1].startswith("  try: ")
    assert sorted(tmp_path.rglob("*")) == before


def test_ctrl_c_leaves_complete_outputs_of_what_was_done(long_recording, fake_network, tmp_path):
    out = tmp_path / "out"
    command = [sys.executable, "-m", "evimo.cli", "run", str(long_recording), "--model", str(fake_network)]
    running = subprocess.Popen(
        [*command, "--sensor", "32x24", "--dense", "--out", str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 120
    while not list(out.glob(f"{MARKER}*/video.mp4")) and time.monotonic() < deadline and running.poll() is None:
        time.sleep(0.05)
    running.send_signal(signal.SIGINT)
    said, errors = running.communicate(timeout=120)
    assert running.returncode == 130, errors
    assert said.startswith("stopped early")
    assert "Traceback" not in errors
    assert names_in(out) == ALL
    summary = json.loads((out / "summary.json").read_text())
    count = summary["slices"]
    assert summary["interrupted"] is True
    assert 0 < count < 2400
    assert len((out / "egomotion.csv").read_text().splitlines()) == count + 1
    with h5py.File(out / "estimates.h5") as maps:
        assert len(maps["ids"]) == len(maps["t_us"]) == count
    with av.open(str(out / "video.mp4")) as container:
        assert sum(1 for _ in container.decode(video=0)) == count
