"""Recordings with truth in every layout, and captures, whole ones to be damaged by `fuzz.py`, and how they are read."""

import tempfile
import warnings
from pathlib import Path
from typing import Any

import cv2
import fuzz_predictions
import numpy as np
from fuzz_bag import bag_files
from numpy.typing import NDArray

from evimo.captures.capture import open_capture
from evimo.errors import EvimoWarning
from evimo.events.events import Events, joined
from evimo.formats import open_events
from evimo.recordings.checking import findings
from evimo.recordings.converting import convert_recording
from evimo.recordings.layouts import found_layout
from evimo.recordings.recording import open_recording

Files = dict[str, bytes]

SIZE, FRAMES, STEP_S = fuzz_predictions.SIZE, 5, 0.025
NUMBERS = {"fx": 30.0, "fy": 30.0, "cx": 15.5, "cy": 11.5, "k1": 0.0, "k2": 0.0, "k3": 0.0, "k4": 0.0}
CAPTURE = """recording: {file: events.txt, sensor: 32x24, time_unit: us, columns: txyp}
mocap: {files: [mocap.csv, b.txt], markers: [markers.csv], offset_us: -1250}
camera:
  body: rig
  intrinsics: {fx: 30, fy: 30, cx: 15.5, cy: 11.5, height: 24, width: 32, lens: radtan, distortion: [0.1, 0, 0, 0]}
  body_from_cam: {position: [0, 0.1, 0], quaternion: [0, 0, 0, 1]}
objects:
  car: {id: 1, body: b, scan: car.ply, unit: mm, markers: car.txt}
room: {scan: room.obj, world_from_scan: {position: [0, 0, 0], quaternion: [0, 0, 0, 1]}}
"""


def read_truth(path: Path) -> None:
    """Read all truth of a recording as training, `evimo view` and `evimo check` do."""
    if found_layout(path) is None:
        return
    recording = open_recording(path)
    if found_layout(path) != "EV-IMO bag":
        for k in range(min(len(recording), 3)):
            recording.truth(k)
            recording.clutter_bodies(k)
        recording.truth_at(int(recording.times_us[0]) + 7_000)
    if recording.paths is not None:
        recording.paths.poses(recording.times_us)
    _ = recording.event_ids, recording.imu
    events = path / "events.txt" if (path / "events.txt").exists() else path
    for _ in findings(path, open_events(events, sensor=recording.camera.size)):
        pass


def read_capture(path: Path) -> None:
    """Read all of a capture, as `evimo annotate` and `evimo locate-markers` do."""
    capture = open_capture(path)
    capture.lens(capture.recording.opened())
    capture.tracks()
    capture.marker_tracks()
    for each in (*capture.objects, *filter(None, [capture.room])):
        each.load()


def frame_words(number: int, at: float) -> dict[str, Any]:
    """One entry of `meta`'s frames: the camera turns, and object 1 moves before it."""
    turn = {"w": float(np.cos(at)), "x": 0.0, "y": float(np.sin(at)), "z": 0.0}
    camera = {"pos": {"t": {"x": 0.1 * at, "y": 0.0, "z": 0.0}, "q": turn}}
    placed = {"pos": {"t": {"x": 0.2 * at, "y": 0.0, "z": 1.0}, "q": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}}}
    return {"id": number, "ts": at, "cam": camera, "1": placed, "gt_frame": f"depth_mask_{number}.png"}


def meta(*, first: bool) -> dict[str, Any]:
    """`meta` in the words of EV-IMO's first version or of EVIMO2."""
    height, width = SIZE
    size = {"res_x": height, "res_y": width} if first else {"res_x": width, "res_y": height}
    more = {} if first else {"dist_model": "radtan", "p1": 0.0, "p2": 0.0}
    frames = [frame_words(k, k * STEP_S) for k in range(FRAMES)]
    trajectory = [frame_words(k, k * 0.005) for k in range(25)]
    return {"meta": NUMBERS | size | more, "frames": frames, "full_trajectory": trajectory}


def whole() -> dict[str, tuple[Files, str]]:
    """Recordings with truth by name: their files, and which of them is opened, "" for the folder."""
    with tempfile.TemporaryDirectory() as made, warnings.catch_warnings():
        warnings.simplefilter("ignore", EvimoWarning)
        folder = Path(made)
        own = open_recording(fuzz_predictions.truth())
        convert_recording(own, folder / "a.h5", "hdf5")
        _archive(folder / "evimo1.npz", first=True)
        _archive(folder / "evimo2.npz", first=False)
        found = {name: ({name: (folder / name).read_bytes()}, name) for name in ("a.h5", "evimo1.npz", "evimo2.npz")}
        return found | {
            "own folder": (_files(fuzz_predictions.truth()), ""),
            "EVIMO2 folder": (_folder(folder / "v2"), ""),
            "EV-IMO text": (_text(), ""),
            "EV-IMO bag": (bag_files(folder, _events()), "seq_00.bag"),
        }


def captures() -> dict[str, tuple[Files, str]]:
    """A capture with tables of poses and markers, and scans in text."""
    times = 5_000 * np.arange(30)
    poses = "".join(f"{t},rig,0,0,{t * 1e-6},0,0,0,1,1\n" for t in times)
    markers = "".join(f"{t * 1e-6},b,{name},0.1,0.2,{k}\n" for t in times for k, name in enumerate("uvw"))
    corners = "0 0 0\n9 0 0\n0 9 0\n0 0 9\n"
    head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    ply = f"{head}element face 2\nproperty list uchar int vertex_indices\nend_header\n{corners}3 0 1 2\n3 0 1 3\n"
    obj = "".join(f"v {line}\n" for line in corners.splitlines()) + "f 1 2 3\nf 1//1 2//1 4//1\n"
    files = {
        "capture.yaml": CAPTURE,
        "events.txt": _lines(),
        "mocap.csv": "t_us,body,x,y,z,qx,qy,qz,qw,tracked\n" + poses,
        "b.txt": "# TUM\n" + "".join(f"{t * 1e-6} 0 0 1 0 0 0 1\n" for t in times),
        "markers.csv": "t,body,marker,x,y,z\n" + markers,
        "car.ply": ply,
        "car.txt": "0 1 2 3\n1 4 5 6\n",
        "room.obj": obj,
    }
    return {"capture": ({name: text.encode() for name, text in files.items()}, "")}


def _events() -> Events:
    return joined([fuzz_predictions.events_in(k) for k in range(fuzz_predictions.SLICES)])


def _rows() -> NDArray[np.float64]:
    events = _events()
    return np.stack((events.t, events.x, events.y, events.p > 0), axis=1).astype(np.float64)


def _lines() -> str:
    return "".join(" ".join(map(str, row)) + "\n" for row in _rows().astype(int).tolist())


def _maps() -> tuple[NDArray[np.uint16], NDArray[np.uint16]]:
    """Depth in mm and masks, (F, H, W)."""
    ids = np.stack([fuzz_predictions.ids_at(k) for k in range(FRAMES)]).astype(np.uint16)
    return np.where(ids > 0, 1000, 2000).astype(np.uint16), 1000 * ids


def _archive(path: Path, *, first: bool) -> None:
    depth, mask = _maps()
    events = _rows() * (1e-6, 1, 1, 1)
    told = np.array(meta(first=first), object)
    np.savez(path, events=events, K=np.eye(3), D=np.zeros(4), depth=depth, mask=mask, meta=told)


def _folder(folder: Path) -> Files:
    folder.mkdir()
    (depth, mask), rows = _maps(), _rows()
    np.save(folder / "dataset_events_t.npy", rows[:, 0] * 1e-6)
    np.save(folder / "dataset_events_xy.npy", rows[:, 1:3].astype(np.uint16))
    np.save(folder / "dataset_events_p.npy", rows[:, 3].astype(np.uint8))
    np.savez(folder / "dataset_depth.npz", **{f"depth_{k:010d}": depth[k] for k in range(FRAMES)})
    np.savez_compressed(folder / "dataset_mask.npz", **{f"mask_{k:010d}": mask[k] for k in range(FRAMES)})
    np.savez(folder / "dataset_info.npz", meta=np.array(meta(first=False), object), K=np.eye(3), D=np.zeros(4))
    return _files(folder)


def _text() -> Files:
    depth, mask = _maps()
    pictures = {
        f"img/depth_mask_{k}.png": cv2.imencode(".png", np.stack((depth[k], depth[k], mask[k]), axis=2))[1].tobytes()
        for k in range(FRAMES)
    }
    events = "".join(f"{t * 1e-6:.6f} {x:.0f} {y:.0f} {p:.0f}\n" for t, x, y, p in _rows().tolist())
    return {"events.txt": events.encode(), "meta.txt": repr(meta(first=True)).encode()} | pictures


def _files(folder: Path) -> Files:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}
