"""`evimo realism` on recordings made by hand."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from evimo.cli import main
from evimo.events.events import Events
from evimo.geometry.camera import Camera
from evimo.recordings.truth import Truth
from evimo.recordings.writer import RecordingWriter

CAMERA = Camera(fx=40.0, fy=40.0, cx=15.5, cy=11.5, height=24, width=32)
SLICES = 4


@pytest.fixture
def simulated(tmp_path: Path) -> Path:
    """A folder of two recordings: every pixel fires twice per slice, 2 ms apart, ON and OFF."""
    y, x = (each.ravel().astype(np.uint16) for each in np.mgrid[:24, :32])
    nothing = np.zeros(CAMERA.size, np.uint8)
    for name in ("a", "b"):
        with RecordingWriter(tmp_path / "made" / name, CAMERA) as writer:
            for k in range(SLICES + 1):
                t = np.repeat((k * 25_000, k * 25_000 + 2000), len(x))
                events = Events(np.tile(x, 2), np.tile(y, 2), t, np.repeat((1, -1), len(x)).astype(np.int8))
                truth = Truth(
                    k * 25_000 + 12_500, nothing + np.float32(1), nothing == 0, nothing, nothing > 0, np.zeros(6), {}
                )
                writer.write(events, truth)
    return tmp_path / "made"


def test_a_table_a_page_numbers_and_a_picture(recording, simulated, tmp_path, capsys):
    out = tmp_path / "new" / "out"
    command = ["realism", str(recording), "--sensor", "32x24", "--simulated", str(simulated), "--out", str(out)]
    assert main(command) == 0
    said = capsys.readouterr().out
    assert "events per active pixel" in said
    assert "square.txt" in said
    assert sorted(file.name for file in out.iterdir()) == ["realism.json", "realism.png", "report.md"]
    saved = json.loads((out / "realism.json").read_text())
    assert [each["name"] for each in saved["simulated"]] == ["a", "b"]
    values = saved["simulated"][0]["values"]
    assert (values["per_active"], values["on"], values["isolated"]) == (2, 0.5, 0)
    assert saved["real"][0]["values"]["on"] == 1
    assert saved["real"][0]["sensor"] == [24, 32]
    picture = cv2.imread(str(out / "realism.png"))
    assert picture.shape == (2 * 470 + 3 * 12, 2 * 760 + 3 * 12, 3)
    assert min(panel.std() for half in np.array_split(picture, 2) for panel in np.array_split(half, 2, axis=1)) > 5


def test_without_a_folder_it_only_prints(recording, simulated, tmp_path, capsys):
    assert main(["realism", str(recording), "--simulated", str(simulated / "a")]) == 0
    assert "give the simulation away" in capsys.readouterr().out
    assert {file.name for file in tmp_path.iterdir()} == {recording.name, "made"}


def test_many_real_recordings_share_a_curve(recording, simulated, tmp_path):
    paths = []
    for number in range(6):
        paths.append(str(tmp_path / f"real{number}.txt"))
        Path(paths[-1]).write_text(recording.read_text())
    out = tmp_path / "out"
    assert main(["realism", *paths, "--simulated", str(simulated), "--out", str(out)]) == 0
    assert (out / "realism.png").exists()


@pytest.mark.parametrize(
    ("missing", "words"),
    [("real", "no real recording given"), ("simulated", "no recording with truth in"), ("file", "there is no")],
)
def test_what_is_missing_is_one_error(missing, words, recording, simulated, tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    real = {"real": [], "file": [str(tmp_path / "nowhere.aedat4")]}.get(missing, [str(recording)])
    made = tmp_path / "empty" if missing == "simulated" else simulated
    assert main(["realism", *real, "--sensor", "32x24", "--simulated", str(made)]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"error: {words}")
    assert said.count("error:") == said.count("try:") == 1


def test_an_empty_real_recording_is_one_error(simulated, tmp_path, capsys):
    (tmp_path / "empty.txt").write_text("")
    assert main(["realism", str(tmp_path / "empty.txt"), "--simulated", str(simulated)]) == 2
    assert capsys.readouterr().err.count("error:") == 1


def test_a_recording_shorter_than_a_slice_is_one_error(simulated, tmp_path, capsys):
    (tmp_path / "short.txt").write_text("0 1 1 1\n10000 2 2 0\n")
    command = ["realism", str(tmp_path / "short.txt"), "--sensor", "32x24", "--simulated", str(simulated)]
    assert main(command) == 2
    assert "short.txt lasts 10.0 ms" in capsys.readouterr().err
