"""What the commands of captures read in `machines.py`: a capture, fragments of a room, a scan with balls, archives."""

import gzip
import re
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import trimesh
import yaml
from numpy.typing import NDArray

STILL = {"position": [0, 0, 0], "quaternion": [0, 0, 0, 1]}
LENS = {"fx": 60, "fy": 60, "cx": 31.5, "cy": 23.5, "height": 48, "width": 64}
ARCHIVE = gzip.compress(np.random.default_rng(0).bytes(300_000))


def save_capture(folder: Path, *, recording: Path) -> Path:
    """A still camera before a wall 2 m away, and a box that moves to the right 1 m away, for 5 s of a recording."""
    folder.mkdir()
    trimesh.creation.box((0.2, 0.2, 0.2)).export(folder / "box.ply")
    wall = np.random.default_rng(1).uniform((-2, -2, 2), (2, 2, 2.001), (40_000, 3))
    trimesh.PointCloud(wall).export(folder / "wall.ply")
    rows = ["t,body,x,y,z,qx,qy,qz,qw"]
    for t in np.arange(0, 5, 0.005):
        rows += [f"{t:.3f},Rig,0,0,0,0,0,0,1", f"{t:.3f},Box,{0.1 * t:.6f},0,1.1,0,0,0,1"]
    (folder / "mocap.csv").write_text("\n".join(rows))
    settings = {
        "recording": {"file": str(recording), "sensor": "64x48", "time_unit": "us"},
        "mocap": {"files": ["mocap.csv"]},
        "camera": {"body": "Rig", "intrinsics": LENS, "body_from_cam": STILL},
        "objects": {"box": {"id": 3, "body": "Box", "scan": "box.ply", "body_from_scan": STILL}},
        "room": {"scan": "wall.ply"},
    }
    (folder / "capture.yaml").write_text(yaml.safe_dump(settings))
    return folder


def save_fragments(folder: Path) -> Path:
    """A list of two scans of one corner of a room."""
    rng = np.random.default_rng(2)
    lines = ["fragments:"]
    for number in range(2):
        corner = rng.uniform(0, 2, (60_000, 3))
        corner[np.arange(len(corner)), rng.integers(0, 3, len(corner))] = 0
        trimesh.PointCloud(corner).export(folder / f"part_{number}.ply")
        lines.append(f"  - {{scan: part_{number}.ply, world_from_scan: {STILL}}}")
    (folder / "fragments.yaml").write_text("\n".join(lines))
    return folder / "fragments.yaml"


def save_scan(path: Path, *, balls: int) -> Path:
    """Balls with a radius of 4 mm on a plate."""
    rng = np.random.default_rng(3)
    plate = rng.uniform((0, 0, -0.0045), (0.05 * balls, 0.05, -0.0044), (4_000 * balls, 3))
    trimesh.PointCloud(np.concatenate([plate, *(_ball(rng, k) for k in range(balls))])).export(path)
    return path


def _ball(rng: np.random.Generator, number: int) -> NDArray[np.float64]:
    ways = rng.normal(size=(900, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    return 0.004 * ways[ways[:, 2] > -0.35][:300] + (0.05 * number + 0.025, 0.025, 0)


class Mirror(BaseHTTPRequestHandler):
    """Archives of EV-IMO, which come slowly where the address says so."""

    def do_GET(self) -> None:
        """Send one, or what is missing of it."""
        asked = re.fullmatch(r"bytes=(\d+)-", self.headers.get("Range") or "")
        rest = ARCHIVE[int(asked[1]) if asked else 0 :]
        self.send_response(206 if asked else 200)
        self.send_header("Content-Length", str(len(rest)))
        self.end_headers()
        step = 1_000 if self.path.startswith("/slow") else len(rest)
        try:
            for at in range(0, len(rest), step):
                self.wfile.write(rest[at : at + step])
                time.sleep(0.1 if step < len(rest) else 0)
        except OSError:  # whoever asked has been ended
            return

    def log_message(self, *_: object) -> None:
        """Nothing."""


def mirror() -> str:
    """The address of a server of archives, which lives as long as this process."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), Mirror)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return f"http://127.0.0.1:{server.server_address[1]}"
