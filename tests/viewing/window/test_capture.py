"""A capture in the window: scans on their bodies, truth drawn from them, markers where motion capture saw them."""

import numpy as np
import pytest

from evimo.cli import main

rerun = pytest.importorskip("rerun", reason="needs rerun-sdk: pip install 'evimo[view]'")
trimesh = pytest.importorskip("trimesh", reason="needs the extra [simulate]")
yaml = pytest.importorskip("yaml")


@pytest.fixture
def desk(tmp_path):
    """A still camera before a wall of points 2 m away, and a box that moves to the right at 0.5 m/s 1 m away."""
    folder = tmp_path / "desk"
    folder.mkdir()
    box = trimesh.creation.box((0.2, 0.2, 0.2))
    box.apply_translation((0.5, 0, 0))  # its scan's origin is elsewhere
    box.export(folder / "box.ply")
    rng = np.random.default_rng(1)
    wall = np.concatenate((rng.uniform(-2, 2, (20_000, 2)), np.full((20_000, 1), 2.0)), axis=1)
    trimesh.PointCloud(wall).export(folder / "wall.ply")
    t_s = np.arange(0, 0.31, 0.005)
    rows = ["t,body,x,y,z,qx,qy,qz,qw"]
    rows += [f"{t:.3f},Rig,0,0,0,0,0,0,1" for t in t_s] + [f"{t:.3f},Box,{0.5 * t:.6f},0,1.1,0,0,0,1" for t in t_s]
    (folder / "mocap.csv").write_text("\n".join(rows))
    seen = ["t,body,marker,x,y,z"] + [f"{t:.3f},Box,top,{0.5 * t:.6f},-0.1,1.1" for t in t_s]
    (folder / "markers.csv").write_text("\n".join(seen))
    lines = (f"{k * 100} {k % 64} {k % 48} {k % 2}" for k in range(3000))
    (folder / "events.txt").write_text("\n".join(lines))
    still = {"position": [0, 0, 0], "quaternion": [0, 0, 0, 1]}
    lens = {"fx": 60, "fy": 60, "cx": 31.5, "cy": 23.5, "height": 48, "width": 64}
    settings = {
        "recording": {"file": "events.txt", "sensor": "64x48", "time_unit": "us"},
        "mocap": {"files": ["mocap.csv"], "markers": ["markers.csv"]},
        "camera": {"body": "Rig", "intrinsics": lens, "body_from_cam": still},
        "objects": {
            "box": {"id": 3, "body": "Box", "scan": "box.ply", "body_from_scan": still | {"position": [-0.5, 0, 0]}}
        },
        "room": {"scan": "wall.ply"},
    }
    (folder / "capture.yaml").write_text(yaml.safe_dump(settings))
    return folder


def test_scans_stand_on_their_bodies_and_truth_follows(desk, tmp_path, read_back):
    out = tmp_path / "desk.rrd"
    assert main(["view", str(desk), "--stop", "0.1", "--save", str(out)]) == 0
    file = read_back(out)
    vertices = np.array(file.rows("world/objects/3/scan", "Mesh3D:vertex_positions")[None])
    (moved,) = file.rows("world/objects/3/scan", "Transform3D:translation")[None]
    (place,) = file.rows("world/objects/3", "Transform3D:translation")[50_000]
    corners = vertices + moved + place  # nothing is turned
    np.testing.assert_allclose(corners.mean(axis=0), (0.025, 0, 1.1), atol=1e-4)
    np.testing.assert_allclose(np.ptp(corners, axis=0), 0.2, atol=1e-5)
    facing = np.array(file.rows("world/objects/3/scan", "Mesh3D:vertex_normals")[None])
    outwards = np.sign(corners - (0.025, 0, 1.1))  # of a cube whose corners belong to three sides each
    assert (facing * outwards > 0.3).all() and np.allclose(np.linalg.norm(facing, axis=1), 1, atol=1e-5)
    assert len(file.rows("world/scan", "Points3D:positions")[None]) == 20_000
    markers = file.rows("world/markers/Box", "Points3D:positions")
    np.testing.assert_allclose(markers[62_500], [(0.5 * 0.0625, -0.1, 1.1)], atol=0.0026)  # seen every 5 ms
    ids = np.array(file.rows("world/camera/image/truth/objects", "SegmentationImage:buffer")[87_500][0], np.uint8)
    columns = np.flatnonzero((ids.reshape(48, 64) == 3).any(axis=0))
    assert columns[0] == np.ceil(31.5 + 60 * (0.04375 - 0.1)) and columns[-1] == np.floor(31.5 + 60 * (0.04375 + 0.1))
    speeds = file.rows("speeds/objects/truth/3", "Scalars:scalars")
    assert sorted(speeds) == [12_500, 37_500, 62_500, 87_500]
    np.testing.assert_allclose([value for (value,) in speeds.values()], 0.5, atol=1e-3)


def test_a_capture_that_is_not_calibrated_says_so(desk, tmp_path, capsys):
    file = desk / "capture.yaml"
    settings = yaml.safe_load(file.read_text())
    del settings["camera"]["body_from_cam"]
    file.write_text(yaml.safe_dump(settings))
    assert main(["view", str(desk), "--save", str(tmp_path / "new" / "d.rrd")]) == 2
    said = capsys.readouterr().err.splitlines()[-2:]
    assert "lacks `body_from_cam`" in said[0] and said[1].startswith("  try: ")
    assert not (tmp_path / "new").exists()
    assert main(["view", str(desk), "--save", str(tmp_path / "d.mp4")]) == 2
    assert "is a capture" in capsys.readouterr().err
