"""A capture small enough to write down, whose truth is known."""

from pathlib import Path

import numpy as np
import trimesh
import yaml


def save_desk(folder: Path, *, points: int = 40_000) -> Path:
    """A still camera before a wall of points 2 m away, and a box that moves to the right at 0.5 m/s 1 m away."""
    folder.mkdir(parents=True)
    trimesh.creation.box((0.2, 0.2, 0.2)).export(folder / "box.ply")
    rng = np.random.default_rng(1)
    wall = np.concatenate((rng.uniform(-2, 2, (points, 2)), np.full((points, 1), 2.0)), axis=1)
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
