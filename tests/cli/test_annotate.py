"""`evimo annotate` as users call it: a capture becomes recordings, once, and mistakes are two lines."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from tests.captures.desk import save_desk

from evimo.cli import main
from evimo.recordings.recording import open_recording


@pytest.fixture
def desk(tmp_path: Path) -> Path:
    return save_desk(tmp_path / "desk")


def test_a_capture_becomes_a_recording_once(desk, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["annotate", str(desk), "--out", str(out)]) == 0
    assert "1 recordings in" in capsys.readouterr().out
    recording = open_recording(out / "desk_000000")
    assert len(recording) == 8 and recording.times_us[0] == 12_500
    truth = recording.truth(4)  # at 112.5 ms the box's face, 0.2 m wide, is 12 px wide, 1 m away, 56 mm to the right
    columns = np.flatnonzero((truth.ids == 3).any(axis=0))
    assert columns[0] == np.ceil(31.5 + 60 * (0.05625 - 0.1))  # the first pixel whose centre sees it, and the last
    assert columns[-1] == np.floor(31.5 + 60 * (0.05625 + 0.1))
    assert np.abs(truth.depth[truth.ids == 3] - 1).max() < 0.002
    assert truth.valid.all() and np.abs(truth.depth[truth.ids == 0] - 2).max() < 0.002
    np.testing.assert_allclose(truth.objects[3].velocity, [0.5, 0, 0], atol=1e-6)
    np.testing.assert_allclose(truth.ego, 0, atol=1e-9)
    stamp = (out / "desk_000000" / "dataset_info.json").stat().st_mtime_ns
    assert main(["annotate", str(desk), "--out", str(out)]) == 0
    assert "0 of them made now" in capsys.readouterr().out
    assert (out / "desk_000000" / "dataset_info.json").stat().st_mtime_ns == stamp


def test_long_captures_become_parts_and_only_missing_ones_are_made(desk, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("evimo.annotate.annotation.PART_US", 75_000)
    out = tmp_path / "out"
    assert main(["annotate", str(desk), "--out", str(out), "--rate", "200", "--layout", "evimo1"]) == 0
    names = ["desk_000000.npz", "desk_000001.npz", "desk_000002.npz"]
    assert sorted(path.name for path in out.iterdir()) == names
    parts = [open_recording(out / name) for name in names]
    assert np.diff(np.concatenate([part.times_us for part in parts])).tolist() == [5000] * 39
    assert sum(part.event_count() for part in parts) == 2000
    (out / names[1]).unlink()
    assert main(["annotate", str(desk), "--out", str(out), "--rate", "200", "--layout", "evimo1"]) == 0
    assert "3 recordings in" in (said := capsys.readouterr().out) and "1 of them made now" in said


def test_a_part_in_which_the_camera_is_lost_is_left_out(desk, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("evimo.annotate.annotation.PART_US", 75_000)
    text = (desk / "mocap.csv").read_text().splitlines()
    kept = [line for line in text if ",Rig," not in line or float(line.partition(",")[0]) < 0.07]
    (desk / "mocap.csv").write_text("\n".join(kept))
    assert main(["annotate", str(desk), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr()
    assert "1 recordings in" in said.out and "no pose of the camera from 75000 to 150000" in said.err
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["desk_000000"]


def contents(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in sorted(folder.rglob("*")) if file.is_file()}


@pytest.mark.slow
def test_several_captures_are_the_same_bytes_whoever_draws(tmp_path, capsys):
    captures = [str(save_desk(tmp_path / name, points=2000)) for name in ("desk", "table")]
    command = ["annotate", *captures, "--rate", "20", "--out"]
    assert main([*command, str(tmp_path / "alone"), "--threads", "1"]) == 0
    assert main([*command, str(tmp_path / "two"), "--workers", "2"]) == 0
    assert capsys.readouterr().out.count("2 recordings in") == 2
    made = contents(tmp_path / "two")
    assert made == contents(tmp_path / "alone")
    assert {name.partition("/")[0] for name in made} == {"desk_000000", "table_000000"}
    shutil.rmtree(tmp_path / "two" / "desk_000000")
    assert main([*command, str(tmp_path / "two"), "--workers", "2"]) == 0
    assert "1 of them made now" in capsys.readouterr().out
    assert contents(tmp_path / "two") == made


def test_a_broken_capture_costs_its_own_recordings(desk, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("evimo.annotate.annotation.PART_US", 100_000)
    broken = save_desk(tmp_path / "broken")
    (broken / "mocap.csv").write_text("t,body,x,y,z,qx,qy,qz,qw\n0,Rig,0,0,one,0,0,0,1")
    assert main(["annotate", str(broken), str(desk), "--out", str(tmp_path / "out")]) == 2
    error, fix = capsys.readouterr().err.splitlines()[-2:]
    assert error.startswith("error: 2 of 4 failed: ") and fix.startswith("  try: ")
    assert error.count("mocap.csv, line 2") == 1  # said once, though it fails both of its recordings
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["desk_000000", "desk_000001"]


def test_what_was_made_otherwise_is_not_taken_for_what_is_asked(desk, tmp_path, capsys):
    command = ["annotate", str(desk), "--out", str(tmp_path / "out"), "--rate"]
    (tmp_path / "times").write_text("50000")
    assert main([*command, str(tmp_path / "times")]) == 0
    assert main([*command, "40"]) == 2
    assert "desk_000000 is there already, made with times 1 of sha256" in capsys.readouterr().err
    assert main([*command, str(tmp_path / "times")]) == 0
    settings = desk / "capture.yaml"
    settings.write_text(settings.read_text().replace("id: 3", "id: 4"))
    assert main([*command, str(tmp_path / "times")]) == 2
    assert "made with other settings of its capture\n  try: another --out" in capsys.readouterr().err


def test_captures_of_one_name_are_refused(desk, tmp_path, capsys):
    other = save_desk(tmp_path / "other" / "desk")
    assert main(["annotate", str(desk), str(other), "--out", str(tmp_path / "out")]) == 2
    assert f"{desk} and {other} would both be written to {tmp_path / 'out' / 'desk'}" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("Box,", "Bix,"), "no body 'Box'"),
        (("Rig,0,0,0,0,0,0,1", "Rig,,,,,,,"), "no pose of the camera"),
        (("0,0,0,1", "0,0,one,1"), "mocap.csv, line 2"),
    ],
)
def test_mistakes_are_two_lines(desk, tmp_path, capsys, change, words):
    path = desk / "mocap.csv"
    path.write_text(path.read_text().replace(*change))
    assert main(["annotate", str(desk), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert words in said and "\n  try: " in said and "Traceback" not in said
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())
