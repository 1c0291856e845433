import signal
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import av
import numpy as np
import pytest

from evimo.cli import main
from evimo.events.events import Events
from evimo.geometry.camera import Camera
from evimo.recordings.truth import ObjectTruth, Truth
from evimo.recordings.writer import RecordingWriter
from evimo.writing import MARKER

SIZE = (24, 32)


def frames_of(path: Path) -> list[np.ndarray]:
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


def length_s(path: Path) -> float:
    with av.open(str(path)) as container:
        return container.duration / 1e6


def seen(code: int, path: Path) -> list[np.ndarray]:
    assert code == 0
    return frames_of(path)


@pytest.fixture
def film(tmp_path: Path) -> Path:
    """Eight slices of a recording with truth; nothing happens in the last two."""
    rng = np.random.default_rng(0)
    with RecordingWriter(tmp_path / "film", Camera(30.0, 30.0, 15.5, 11.5, *SIZE), facts={"seed": 1}) as writer:
        for k in range(8):
            t = np.sort(rng.integers(k * 25_000, (k + 1) * 25_000, 0 if k > 5 else 60))
            x, y = (rng.integers(0, side, len(t)).astype(np.uint16) for side in SIZE[::-1])
            ids = np.zeros(SIZE, np.uint8)
            ids[8:16, 4 + k : 14 + k] = 1
            one = ObjectTruth(np.array((0.0, 0, 1)), np.array((0.4, 0, 0)), np.zeros(3))
            depth = np.where(ids, 1, 2).astype(np.float32)
            truth = Truth(k * 25_000 + 12_500, depth, depth > 0, ids, depth < 0, np.zeros(6), {1: one})
            writer.write(Events(x, y, t, np.ones(len(t), np.int8)), truth)
    return tmp_path / "film"


def test_truth_becomes_a_video_of_every_slice(film, tmp_path, capsys):
    out = tmp_path / "new" / "v.mp4"
    frames = seen(main(["view", str(film), "--no-picture", "--save", str(out)]), out)
    assert len(frames) == 8
    assert length_s(out) == pytest.approx(0.8, rel=0.02)  # four times slower
    assert all(np.abs(one.astype(int) - other).max() > 50 for one, other in pairwise(frames))
    said = capsys.readouterr()
    assert said.out == f"8 frames, 0.2 s of recording\n  {out}\n"
    assert not said.err


def test_a_file_in_the_layout_of_ev_imo_looks_as_a_folder_does(tmp_path):
    command = ["simulate", "--set", "3", "--minutes", "0.001", "--seconds", "0.05", "--size", "32x24", "--seed", "6"]
    for layout in ("evimo1", "evimo2"):
        assert main([*command, "--layout", layout, "--out", str(tmp_path / layout)]) == 0
    shown = []
    for path in (tmp_path / "evimo1" / "set3_000006.npz", tmp_path / "evimo2" / "set3_000006"):
        out = tmp_path / f"{path.parent.name}.mp4"
        shown.append(seen(main(["view", str(path), "--save", str(out)]), out))
    assert len(shown[0]) == 2
    np.testing.assert_array_equal(*shown)


def test_a_recording_that_cannot_be_made_again_has_no_pictures(film, tmp_path, capsys):
    code = main(["view", str(film), "--save", str(tmp_path / "v.mp4")])
    plain = main(["view", str(film), "--no-picture", "--save", str(tmp_path / "w.mp4")])
    assert seen(code, tmp_path / "v.mp4")[0].shape == seen(plain, tmp_path / "w.mp4")[0].shape
    warned = [line for line in capsys.readouterr().err.splitlines() if line.startswith("warning: ")]
    assert len(warned) == 1 and "cannot be rendered again" in warned[0]


def test_start_stop_and_speed(film, tmp_path):
    out = tmp_path / "v.mp4"
    part = ["--no-picture", "--start", "0.05", "--stop", "0.15", "--save", str(out)]
    assert len(seen(main(["view", str(film), *part]), out)) == 4
    assert len(seen(main(["view", str(film), *part, "--speed", "3"]), out)) == 2  # of 120 per second every second
    assert length_s(out) == pytest.approx(0.1 / 3, rel=0.1)


def test_a_recording_without_truth_shows_its_events(recording, tmp_path):
    out = tmp_path / "square.mp4"
    frames = seen(main(["view", str(recording), "--sensor", "32x24", "--save", str(out)]), out)
    assert len(frames) == 20
    red, _, blue = np.moveaxis(frames[0].astype(int), -1, 0)
    assert np.count_nonzero(red - blue > 60) > 1000  # all its events are ON


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["nowhere", "--save", "v.mp4"], "nowhere"),
        (["FILM", "--save", "v.avi"], "v.avi is no name of a Rerun file or of a video"),
        (["FILM", "--save", "FILM"], "is no name of a Rerun file or of a video"),
        (["FILM", "--save", "v.mp4", "--web"], "--web and --save at once"),
        (["FILM", "--speed", "0"], "to play 0 times as fast"),
        (["FILM", "--save", "v.mp4", "--start", "7"], "no part of a recording of"),
        (["FILM", "--save", "v.mp4", "--stop", "0.01"], "no complete slice"),
        (["FILM", "--save", "TEXT/v.mp4"], "cannot write"),
        (["TEXT", "--save", "v.mp4", "--sensor", "large"], "'large' is not a sensor size"),
        (["DAMAGED", "--save", "v.mp4"], "lacks dataset_sim.npz"),
        (["FILM", "--save", "v.mp4", "--recording", "TEXT"], "is of a run"),
        (["RUN", "--save", "v.mp4"], "is of a run"),
        (["w.rrd", "--save", "v.mp4"], "is a Rerun file"),
    ],
)
def test_bad_input_is_one_clear_error(film, recording, tmp_path, monkeypatch, capsys, arguments, problem):
    monkeypatch.chdir(tmp_path)
    damaged = film.with_name("damaged")
    damaged.mkdir()
    (damaged / "dataset_clutter.npz").touch()
    (damaged / "dataset_info.json").write_text((film / "dataset_info.json").read_text())
    run = film.with_name("run")
    run.mkdir()
    (run / "summary.json").write_text("{}")
    names = {"FILM": str(film), "TEXT": str(recording), "DAMAGED": str(damaged), "RUN": str(run)}
    before = sorted(tmp_path.rglob("*"))
    words = [word.replace("TEXT", names["TEXT"]) if "TEXT" in word else names.get(word, word) for word in arguments]
    assert main(["view", *words]) == 2
    said = [
        line
        for line in capsys.readouterr().err.splitlines()
        if not line.startswith(("warning: ", "rendering ", "compiling", "still"))
    ]
    assert len(said) == 2
    assert said[0].startswith("error: ") and problem in said[0]
    assert said[1].startswith("  try: ")
    assert sorted(tmp_path.rglob("*")) == before


def test_ctrl_c_leaves_a_complete_shorter_video(long_recording, tmp_path):
    out = tmp_path / "out" / "v.mp4"
    command = [sys.executable, "-m", "evimo.cli", "view", str(long_recording), "--sensor", "32x24", "--save", str(out)]
    running = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 120
    while not any(file.stat().st_size for file in out.parent.glob(f"{MARKER}*/v.mp4")) and time.monotonic() < deadline:
        assert running.poll() is None
        time.sleep(0.02)
    running.send_signal(signal.SIGINT)
    said, errors = running.communicate(timeout=120)
    assert running.returncode == 130, errors
    assert said.startswith("stopped early") and "Traceback" not in errors
    assert list(out.parent.iterdir()) == [out]
    assert 0 < len(frames_of(out)) < 2400
