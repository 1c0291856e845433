"""A run beside its recording: scaled by truth, found again, or shown alone."""

import json
from dataclasses import asdict

import cv2
import numpy as np
import pytest

from evimo.cli import main
from evimo.recordings.estimate import Estimate
from evimo.streaming.estimates_file import EstimatesFile

rerun = pytest.importorskip("rerun", reason="needs rerun-sdk: pip install 'evimo[view]'")

SIZE = (24, 32)


@pytest.fixture
def run(film, tmp_path):
    """Estimates that are true but for their unit, of half the metres, and for the number of the object."""
    folder = tmp_path / "run"
    folder.mkdir()
    valid = np.ones(SIZE, np.bool_)
    file = EstimatesFile(folder / "estimates.h5", valid, attributes={"recording": "film", "model": "none"})
    rows = ["t_us,object,rel_vx,rel_vy,rel_vz"]
    for k in range(6):
        ids = np.zeros(SIZE, np.uint8)
        ids[8:16, 4 + k : 14 + k] = 3
        depth, t_us = np.where(ids, 0.5, 1).astype(np.float32), k * 25_000 + 12_500
        ego = np.array((0.4, 0, 0, 0, 0, 0.5))
        nothing = np.zeros((2, *SIZE), np.float32)
        moving = (ids > 0).astype(np.float32)
        file.write(
            Estimate(
                t_us, t_us - 12_500, t_us + 12_500, moving, ids, depth, nothing, depth, valid, ego, (), None, k != 2
            )
        )
        rows.append(f"{t_us},3,0.2,0.0,0.0")
    file.close()
    (folder / "objects.csv").write_text("\n".join(rows) + "\n")
    from evimo.geometry.camera import Camera

    told = {"camera": asdict(Camera(30.0, 30.0, 15.5, 11.5, *SIZE)) | {"source": "test"}}
    (folder / "summary.json").write_text(json.dumps(told | {"recording": {"name": "film", "path": str(film)}}))
    return folder


def told_of(run, **changed):
    path = run / "summary.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changed))


def test_estimates_stand_beside_truth_and_in_its_scale(run, tmp_path, read_back):
    assert main(["view", str(run), "--save", str(tmp_path / "r.rrd")]) == 0
    file = read_back(tmp_path / "r.rrd")
    (png,) = file.rows("world/camera/image/estimate/depth", "EncodedDepthImage:blob")[37_500]
    depth = cv2.imdecode(np.array(png, np.uint8), cv2.IMREAD_UNCHANGED)
    assert (depth[8, 4], depth[8, 5]) == (2000, 1000)
    assert [value for (value,) in file.rows("speeds/objects/estimate/3", "Scalars:scalars").values()] == pytest.approx(
        [0.4] * 5
    )
    assert file.rows("speeds/translation/estimate", "Scalars:scalars")[12_500] == pytest.approx([0.8])
    assert file.rows("speeds/rotation/estimate", "Scalars:scalars")[12_500] == pytest.approx([np.degrees(0.5)])
    origins = file.rows("world/camera/estimate/velocities", "Arrows3D:origins")
    # The mask's middle is column 8.5 + k and row 11.5, at 1 m.
    np.testing.assert_allclose(origins[12_500][0], ((8.5 - 15.5) / 30, 0, 1), atol=1e-6)
    assert sorted(file.rows("speeds/translation/truth", "Scalars:scalars")) == [12_500 + 25_000 * k for k in range(6)]


def test_a_slice_without_events_shows_no_estimate(run, tmp_path, read_back):
    assert main(["view", str(run / "estimates.h5"), "--save", str(tmp_path / "r.rrd")]) == 0
    file = read_back(tmp_path / "r.rrd")
    assert 62_500 not in file.rows("speeds/translation/estimate", "Scalars:scalars")
    cleared = file.rows("world/camera/image/estimate/objects", "Clear:is_recursive")
    assert [time for time, value in cleared.items() if value] == [62_500]
    for curve in ("translation/estimate", "objects/estimate/3"):  # no line is drawn across
        assert 62_500 in file.rows(f"speeds/{curve}", "Clear:is_recursive")


def test_without_its_recording_a_run_is_shown_alone_in_mean_depths(run, tmp_path, read_back, capsys):
    told_of(run, recording={"name": "film", "path": str(tmp_path / "gone")})
    assert main(["view", str(run), "--save", str(tmp_path / "r.rrd")]) == 0
    assert "--recording PATH" in capsys.readouterr().err
    file = read_back(tmp_path / "r.rrd")
    assert file.rows("speeds/translation/estimate", "Scalars:scalars")[12_500] == pytest.approx([0.4])
    assert "/world/camera/image/events" not in file.chunks


def test_a_recording_that_moved_can_be_given(run, film, tmp_path, read_back):
    told_of(run, recording={"name": "film", "path": str(tmp_path / "gone")})
    command = ["view", str(run), "--recording", str(film), "--save", str(tmp_path / "r.rrd")]
    assert main(command) == 0
    assert "/world/camera/image/events" in read_back(tmp_path / "r.rrd").chunks


@pytest.mark.parametrize(
    ("damage", "problem"),
    [
        (lambda run: (run / "estimates.h5").unlink(), "left no estimates.h5"),
        (lambda run: (run / "estimates.h5").write_bytes(b"no"), "no HDF5 file"),
        (lambda run: (run / "summary.json").write_text("[1"), "not the JSON"),
        (lambda run: told_of(run, camera={"fx": "wide"}), "tells of no camera"),
    ],
)
def test_damage_is_one_clear_error_and_leaves_nothing(run, tmp_path, capsys, damage, problem):
    damage(run)
    if problem == "tells of no camera":
        told_of(run, recording={})
    assert main(["view", str(run), "--save", str(tmp_path / "new" / "r.rrd")]) == 2
    said = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("warning: ")]
    assert len(said) == 2 and problem in said[0] and said[1].startswith("  try: ")
    assert not (tmp_path / "new").exists()
