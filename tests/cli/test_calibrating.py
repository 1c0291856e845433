"""`evimo locate-markers` and `evimo calibrate` on real calibration data, and on small captures with planted truth."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evimo.calibrating.rigid import angle_between, pose
from evimo.captures.entries import load_entries
from evimo.cli import main

WAND, LIGHTS = "calibration/wand_prophesee_00", "calibration/wand/coordinates.txt"
PUBLISHED = {"cam_1": "left_camera", "cam_2": "right_camera"}


def test_markers_of_a_real_scan_are_listed(shared_data, tmp_path, capsys):
    assert main(["locate-markers", str(shared_data("scans/cup")), "--out", str(tmp_path)]) == 0
    rows = np.loadtxt(tmp_path / "cup_markers.txt")
    listed = np.loadtxt(shared_data("scans/cup/config.txt"))[:, 1:]
    assert np.linalg.norm(listed[:, None] - rows[:, 1:], axis=2).min(axis=1).max() < 2e-4
    assert "6 markers" in capsys.readouterr().out


@pytest.mark.parametrize("camera", PUBLISHED)
def test_evimo2s_wand_is_calibrated(camera, shared_data, tmp_path, capsys):
    """To 1.5 px at most; and within 6 mm and 0.6 degrees of what was published, whose own days differ by 8 mm."""
    folder, out = shared_data(WAND), tmp_path / "calibration.yaml"
    command = ["calibrate", str(folder), "--target", str(shared_data(LIGHTS)), "--camera", camera, "--out", str(out)]
    assert main([*command, "--calibration", str(folder / f"{camera}.yaml")]) == 0
    assert median_px(capsys) < 1.5
    found = load_entries(out).named()["camera"].named()["body_from_cam"].pose()
    assert (tmp_path / "calibration.png").stat().st_size > 10_000
    numbers = np.loadtxt(shared_data(f"calibration/rig/config/{PUBLISHED[camera]}/extrinsics.txt"), max_rows=1)
    published = pose(Rotation.from_euler("xyz", numbers[3:]).as_matrix(), numbers[:3])
    assert np.linalg.norm(found[:3, 3] - published[:3, 3]) < 0.006
    assert np.degrees(angle_between(found, published)) < 0.6
    assert main(command) == 0  # and its lens from nothing
    assert median_px(capsys) < 1.5
    assert 520 < load_entries(out).named()["camera"].named()["intrinsics"].named()["fx"].number() < 580


def median_px(capsys):
    return float(capsys.readouterr().out.split("median ")[1].split(" px")[0])


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["locate-markers"], "no scan given"),
        (["locate-markers", "missing.ply"], "missing.ply"),
        (["locate-markers", "missing.ply", "--radius", "9-2"], "--radius"),
        (["calibrate", "missing", "--target", "missing.yaml"], "missing"),
        (["calibrate", "missing"], "no capture"),
        (["calibrate", "missing", "--window", "50"], "impossible times"),
        (["calibrate", "missing", "--out", ""], "--out is the folder '.'"),
        (["align-room", "missing.yaml", "--out", "room.ply"], "missing.yaml"),
    ],
)
def test_wrong_input_is_two_lines(arguments, says, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    said = capsys.readouterr().err
    assert says in said and said.count("\n") == 2


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("kind: ball\nbody: W\n", "line 1"),
        ("kind: wand\nbody: W\nlights:\n  A: [0, 0, 0]\n", "line 3"),
        ("kind: wand\nbody: W\nlights:\n  A: [0, 0]\n", "line 4"),
        ("kind: board\nbody: W\ncorners: [7, 5]\nsquare: 30\n", "line 4"),
        ("kind: board\nbody: W\ncorners: 7\nsquare: 0.03\n", "line 3"),
        ("red ir\nA (1 2 3) (1 2 3)\nB (1 2) (1 2 3)\n", "line 3"),
    ],
)
def test_wrong_targets_are_named_with_their_line(text, says, capsys, tmp_path):
    (tmp_path / "target.yaml").write_text(text)
    assert main(["calibrate", str(tmp_path), "--target", str(tmp_path / "target.yaml")]) == 2
    assert says in capsys.readouterr().err
