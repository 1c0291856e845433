"""Fragments of a known room, tracked a little wrongly, come together again where motion capture has them on average."""

from importlib.util import find_spec

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evimo.calibrating.fragments import align_fragments, depth_points
from evimo.calibrating.rigid import angle_between, inverse, moved, pose
from evimo.cli import main
from evimo.geometry.camera import Camera

SIZE = np.array((4.0, 3.0, 2.5))
needs_icp = pytest.mark.skipif(find_spec("small_gicp") is None, reason="needs small-gicp")


def room_points(rng, count):
    """Walls, floor and ceiling of a room, and two boxes, with a scanner's noise."""
    walls = rng.uniform(0, 1, (count, 3)) * SIZE
    axis, side = rng.integers(0, 3, count), rng.integers(0, 2, count)
    walls[np.arange(count), axis] = side * SIZE[axis]
    boxes = []
    for low, high in (((0.5, 0.4, 0), (1.2, 1.0, 0.8)), ((2.6, 1.8, 0), (3.3, 2.6, 1.3))):
        box = rng.uniform(low, high, (count // 6, 3))
        axis, side = rng.integers(0, 3, len(box)), rng.integers(0, 2, len(box))
        box[np.arange(len(box)), axis] = np.where(side, np.array(high)[axis], np.array(low)[axis])
        boxes.append(box)
    return np.concatenate([walls, *boxes]) + rng.normal(0, 0.002, (count + 2 * (count // 6), 3))


def looked_at(rng, count=5):
    """Fragments on the scanner's axes, the true poses, and what is tracked."""
    angles = np.stack((*rng.uniform(-20, 20, (2, count)), 60 * np.arange(count)), axis=1)
    turn = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    true = pose(turn, SIZE / 2 + rng.uniform(-0.4, 0.4, (count, 3)))
    off = pose(Rotation.from_rotvec(rng.normal(0, 0.01, (count, 3))).as_matrix(), rng.normal(0, 0.015, (count, 3)))
    pieces = []
    for each in true:
        seen = moved(inverse(each), room_points(rng, 12_000))
        pieces.append(seen[seen[:, 0] > -0.3])  # what lies before the scanner, and some beside it
    return pieces, true, true @ off


@needs_icp
def test_planted_poses_are_found():
    rng = np.random.default_rng(4)
    pieces, true, tracked = looked_at(rng)
    room = align_fragments(pieces, tracked, spacing_m=0.03)
    relative = inverse(room.world_from_scan[:1]) @ room.world_from_scan
    expected = inverse(true[:1]) @ true
    was = inverse(tracked[:1]) @ tracked
    assert np.linalg.norm(relative[:, :3, 3] - expected[:, :3, 3], axis=1).max() < 0.006
    assert np.degrees(angle_between(relative, expected)).max() < 0.25
    assert np.linalg.norm(was[:, :3, 3] - expected[:, :3, 3], axis=1).max() > 0.02
    assert room.aligned.all() and room.after_m < room.before_m
    assert np.linalg.norm((room.world_from_scan - tracked)[:, :3, 3].mean(axis=0)) < 0.005  # mocap's world stays


def test_a_depth_image_becomes_points():
    camera = Camera(50.0, 50.0, 31.5, 23.5, 48, 64)
    depth = np.zeros(camera.size)
    depth[10, 20], depth[11, 21], depth[12, 22] = 2.0, 9.0, np.nan
    points = depth_points(depth, *camera.normalised(camera.pixels()), farthest_m=4.0)
    assert np.allclose(points, [((20 - 31.5) / 50 * 2, (10 - 23.5) / 50 * 2, 2.0)])


@needs_icp
def test_the_command_writes_a_room_that_a_capture_takes(tmp_path, capsys):
    from evimo.captures.entries import pose_words
    from evimo.captures.scans import load_scan
    from evimo.cli.align_room import _write_ply

    pieces, _, tracked = looked_at(np.random.default_rng(5), count=2)
    lines = ["fragments:"]
    for number, (piece, place) in enumerate(zip(pieces, tracked, strict=True)):
        _write_ply(tmp_path / f"{number}.ply", piece)
        lines.append(f"  - {{scan: {number}.ply, world_from_scan: {pose_words(place)}}}")
    (tmp_path / "room.yaml").write_text("\n".join(lines))
    command = ["align-room", str(tmp_path / "room.yaml"), "--out", str(tmp_path / "room.ply"), "--spacing", "40"]
    assert main(command) == 0
    assert len(load_scan(tmp_path / "room.ply").points) > 3000
    assert "gap between fragments" in capsys.readouterr().out
    (tmp_path / "room.yaml").write_text("fragments:\n  - {scan: 0.ply}\n")
    assert main(command) == 2
    assert "line 2" in capsys.readouterr().err
