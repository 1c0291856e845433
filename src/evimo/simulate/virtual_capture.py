"""A simulated recording as if it had been captured: scans, and motion capture with noise, losses and its own clock.

What annotation and calibration make of it can be held against what the simulator knows exactly.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
import yaml
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from evimo.captures.capture import CAPTURE
from evimo.captures.entries import pose_words
from evimo.recordings.writer import RecordingWriter
from evimo.scene.motion import random_rotation
from evimo.simulate.recording import SimulatedRecording, SimulatedSlice
from evimo.simulate.shapes import body_triangles
from evimo.writing import new_folder

F8 = NDArray[np.float64]

RECORDING, MOCAP, MARKERS, CALIBRATION = "recording", "mocap.csv", "markers.csv", "calibration.yaml"
CAMERA_BODY, MARKER_COUNT = "Rig", 5


@dataclass(frozen=True, kw_only=True)
class MocapErrors:
    """How motion capture errs.

    rate: samples per second. position_m, turn_rad: standard deviation along each axis. marker_m: of markers.
    dropped: share of samples that are lost, each body's on its own. offset_us: its clock shows so much less than the
    events'. lost: bodies that are not seen from one time to another, s.
    """

    rate: float = 200.0
    position_m: float = 2e-4
    turn_rad: float = 5e-4
    marker_m: float = 2e-4
    dropped: float = 0.02
    offset_us: int = 0
    lost: tuple[tuple[str, float, float], ...] = ()


@dataclass(frozen=True)
class Planted:
    """What the tools that calibrate a capture should find: (4, 4) each, by the object's name."""

    body_from_cam: F8
    body_from_scan: dict[str, F8]
    offset_us: int


def capture_virtually(
    recording: SimulatedRecording, folder: Path, errors: MocapErrors, *, calibrated: bool = True
) -> tuple[Planted, list[SimulatedSlice]]:
    """Write a capture of a simulated recording, and return what is to be found and the exact truth, slice by slice.

    The objects are named `object_1`, `object_2`, …, their bodies `Object_1`, … The axes of a scan are those of its
    simulated body, and a body's axes lie anyhow to them, as motion capture chooses them.

    Args:
        recording: what is captured.
        folder: to make; it must not exist.
        errors: of motion capture.
        calibrated: whether the file of calibration is written, as if the tools had been run.
    """
    rng = np.random.default_rng((recording.plan.seed, 0xCA97))
    count = len(recording.scene.movers)
    planted = Planted(
        _anyhow(rng, 0.05), {f"object_{k + 1}": _anyhow(rng, 0.1) for k in range(count)}, errors.offset_us
    )
    with new_folder(folder) as inside:
        slices = list(_written(recording, inside / RECORDING))
        marked = _write_scans(recording, inside, rng)
        _write_mocap(recording, inside, errors, (planted, marked, rng))
        settings = _settings(recording, count)
        (inside / CAPTURE).write_text(
            yaml.safe_dump(settings | {"calibration": [CALIBRATION]} if calibrated else settings)
        )
        if calibrated:
            (inside / CALIBRATION).write_text(yaml.safe_dump(_found(planted)))
    return planted, slices


def _anyhow(rng: np.random.Generator, reach_m: float) -> F8:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = random_rotation(rng), rng.normal(scale=reach_m, size=3)
    return pose


def _written(recording: SimulatedRecording, folder: Path) -> Iterator[SimulatedSlice]:
    with RecordingWriter(folder, recording.camera) as writer:
        for piece in recording:
            writer.write(piece.events, piece.truth)
            yield piece


def _write_scans(recording: SimulatedRecording, folder: Path, rng: np.random.Generator) -> list[F8]:
    """Scans of the objects with their markers, and of all that stands still; the markers of each object, (K, 3)."""
    scene, marked = recording.scene, list[F8]()
    (folder / "scans").mkdir()  # a scene without movers has a room still
    for number, body in enumerate(scene.movers, 1):
        place = folder / "scans" / f"object_{number}"
        place.mkdir()
        mesh = trimesh.Trimesh(*body_triangles((body,), scene.meshes), process=False)
        mesh.export(place / "model.ply")
        spots = mesh.vertices[rng.permutation(len(mesh.vertices))[:MARKER_COUNT]]
        lines = (f"{k} " + " ".join(f"{value:.7f}" for value in spot) for k, spot in enumerate(spots.tolist(), 1))
        (place / "config.txt").write_text("\n".join(lines) + "\n")
        marked.append(np.asarray(spots, np.float64))
    still = tuple(body for body in scene.bodies if body.motion is None)
    trimesh.Trimesh(*body_triangles(still, scene.meshes), process=False).export(folder / "scans" / "room.ply")
    return marked


def _write_mocap(
    recording: SimulatedRecording,
    folder: Path,
    errors: MocapErrors,
    what: tuple[Planted, list[F8], np.random.Generator],
) -> None:
    """Poses and markers, with errors, from half a second before the recording to half a second after it."""
    planted, marked, rng = what
    times_s = np.arange(-0.5, recording.slices * 0.025 + 0.5, 1 / errors.rate)
    exact = recording.poses(np.rint(times_s * 1e6).astype(np.int64))
    world_from_object = exact.world_from_cam[:, None] @ exact.cam_from_object
    bodies = {CAMERA_BODY: exact.world_from_cam @ np.linalg.inv(planted.body_from_cam)}
    for k, (name, body_from_scan) in enumerate(planted.body_from_scan.items()):
        bodies[name.capitalize()] = world_from_object[:, k] @ np.linalg.inv(body_from_scan)
    stamps = np.rint(times_s * 1e6).astype(np.int64) - errors.offset_us
    lines = ["t_us,body,x,y,z,qx,qy,qz,qw"]
    for body, poses in bodies.items():
        seen = rng.random(len(times_s)) >= errors.dropped
        for name, start_s, stop_s in errors.lost:
            seen &= (name != body) | (times_s < start_s) | (times_s >= stop_s)
        place = poses[:, :3, 3] + rng.normal(scale=errors.position_m, size=(len(poses), 3))
        turned = Rotation.from_matrix(poses[:, :3, :3]) * Rotation.from_rotvec(
            rng.normal(scale=errors.turn_rad, size=(len(poses), 3))
        )
        numbers = np.concatenate((place, turned.as_quat()), axis=1)
        lines += [_line(t, (body,), row, ok) for t, row, ok in zip(stamps, numbers.tolist(), seen, strict=True)]
    (folder / MOCAP).write_text("\n".join(lines) + "\n")
    lines = ["t_us,body,marker,x,y,z"]
    for k, spots in enumerate(marked):
        places = np.einsum("tij,mj->tmi", world_from_object[:, k, :3, :3], spots) + world_from_object[:, None, k, :3, 3]
        places += rng.normal(scale=errors.marker_m, size=places.shape)
        seen = rng.random(places.shape[:2]) >= errors.dropped
        for m in rng.permutation(len(spots)).tolist():  # motion capture numbers them in its own order
            words = (f"Object_{k + 1}", f"m{m}")
            rows = zip(stamps, places[:, m].tolist(), seen[:, m], strict=True)
            lines += [_line(t, words, row, ok) for t, row, ok in rows]
    (folder / MARKERS).write_text("\n".join(lines) + "\n")


def _line(t_us: int, words: tuple[str, ...], numbers: list[float], seen: bool) -> str:
    cells = [f"{number:.9f}" if seen else "" for number in numbers]
    return ",".join((str(t_us), *words, *cells))


def _settings(recording: SimulatedRecording, count: int) -> dict[str, object]:
    lens = recording.camera
    intrinsics = {name: getattr(lens, name) for name in ("fx", "fy", "cx", "cy", "height", "width", "lens")}
    objects = {
        f"object_{k}": {"id": k, "body": f"Object_{k}", "scan": f"scans/object_{k}"} for k in range(1, count + 1)
    }
    return {
        "recording": RECORDING,
        "mocap": {"files": [MOCAP], "markers": [MARKERS]},
        "camera": {"body": CAMERA_BODY, "intrinsics": intrinsics | {"distortion": list(lens.distortion)}},
        "objects": objects,
        "room": {"scan": "scans/room.ply"},
    }


def _found(planted: Planted) -> dict[str, object]:
    return {
        "mocap": {"offset_us": planted.offset_us},
        "camera": {"body_from_cam": pose_words(planted.body_from_cam)},
        "objects": {name: {"body_from_scan": pose_words(pose)} for name, pose in planted.body_from_scan.items()},
    }
