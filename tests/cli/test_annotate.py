"""`evimo annotate` as users call it: a capture becomes recordings, once, and mistakes are two lines."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml

from evimo.cli import main
from evimo.recordings.recording import open_recording


@pytest.fixture
def desk(tmp_path: Path) -> Path:
    """A still camera before a wall of points 2 m away, and a box that moves to the right at 0.5 m/s 1 m away."""
    folder = tmp_path / "desk"
    folder.mkdir()
    trimesh.creation.box((0.2, 0.2, 0.2)).export(folder / "box.ply")
    rng = np.random.default_rng(1)
    wall = np.concatenate((rng.uniform(-2, 2, (40_000, 2)), np.full((40_000, 1), 2.0)), axis=1)
    trimesh.PointCloud(wall).export(folder / "wall.ply")
    t_s = np.arange(0, 0.31, 0.005)
    rows = ["t,body,x,y,z,qx,qy,qz,qw"]
    rows += [f"{t:.3f},Rig,0,0,0,0,0,0,1" for t in t_s] + [f"{t:.3f},Box,{0.5 * t:.6f},0,1.1,0,0,0,1" for t in t_s]
    (folder / "mocap.csv").write_text("\n".join(rows))
    lines = (f"{k * 100} {k % 64} {k % 48} {k % 2}" for k in range(2000))
    (folder / "events.txt").write_text("\n".join(lines))
    still = {"position": [0, 0, 0], "quaternion": [0, 0, 0, 1]}
    lens = {"fx": 60, "fy": 60, "cx": 31.5, "cy": 23.5, "height": 48, "width": 64}
    settings = {
        "recording": {"file": "events.txt", "sensor": "64x48", "time_unit": "us"},
        "mocap": {"files": ["mocap.csv"]},
        "camera": {"body": "Rig", "intrinsics": lens, "body_from_cam": still},
        "objects": {"box": {"id": 3, "body": "Box", "scan": "box.ply", "body_from_scan": still}},
        "room": {"scan": "wall.ply"},
    }
    (folder / "capture.yaml").write_text(yaml.safe_dump(settings))
    return folder


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
