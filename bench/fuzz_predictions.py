"""Predictions of a small recording, whole ones to be damaged by `fuzz.py`, and what they are scored against."""

import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import h5py
import numpy as np
from numpy.typing import NDArray

from evimo.events.events import Events
from evimo.geometry.camera import Camera
from evimo.recordings.pose_track import PoseTrack
from evimo.recordings.truth import ObjectTruth, Truth
from evimo.recordings.writer import RecordingWriter
from evimo.streaming.evaluating_predictions import evaluate_predictions

SIZE, SLICES, SLICE_US = (24, 32), 3, 25_000
CENTRES_US = SLICE_US // 2 + SLICE_US * np.arange(SLICES)

_kept: list[tempfile.TemporaryDirectory[str]] = []  # until the process ends


def ids_at(k: int) -> NDArray[np.uint8]:
    """One object, which moves."""
    ids = np.zeros(SIZE, np.uint8)
    ids[5:15, 3 + k : 15 + k] = 1
    return ids


def events_in(k: int) -> Events:
    """An event on every pixel."""
    place = np.random.default_rng(k).permutation(SIZE[0] * SIZE[1])
    y, x = (each.astype(np.uint16) for each in np.divmod(place, SIZE[1]))
    return Events(x, y, k * SLICE_US + np.arange(len(x)) * 30, np.ones(len(x), np.int8))


@cache
def truth() -> Path:
    """The recording, made once in each process."""
    _kept.append(tempfile.TemporaryDirectory())
    folder = Path(_kept[-1].name) / "a"
    camera = Camera(fx=30.0, fy=30.0, cx=15.5, cy=11.5, height=SIZE[0], width=SIZE[1])
    everywhere = np.ones(SIZE, np.bool_)

    def at_rest(times_us: Any) -> PoseTrack:
        still = np.tile(np.eye(4), (len(times_us), 1, 1))
        return PoseTrack(times_us, still, np.array([1], np.uint8), still[:, None])

    with RecordingWriter(folder, camera, facts={"set": 4, "seed": 0}, poses=at_rest) as writer:
        for k in range(SLICES):
            ids, events = ids_at(k), events_in(k)
            mover = {1: ObjectTruth(np.array([0, 0, 1.0]), np.array([0.2, 0, 0]), np.zeros(3))}
            depth = np.where(ids > 0, 1.0, 2.0).astype(np.float32)
            ego = np.array([0.3, 0, 0, 0, 0.2, 0])
            state = Truth(int(CENTRES_US[k]), depth, everywhere, ids, ~everywhere, ego, mover)
            writer.write(events, state, event_ids=ids[events.y, events.x])
    return folder


def scored(path: Path) -> None:
    """Score predictions of the recording."""
    evaluate_predictions(path, truth())


def whole() -> dict[str, tuple[dict[str, bytes], str]]:
    """Predictions of every kind by name: their files, and which of them is given, "" for the folder."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        ids = np.stack([ids_at(k) for k in range(SLICES)])
        rows = np.concatenate([_labelled(k) for k in range(SLICES)])
        np.savez(folder / "ids.npz", ids=ids, times=CENTRES_US)
        np.savez_compressed(folder / "masks.npz", masks=(ids * 0.9).astype(np.float32), times=CENTRES_US * 1e-6)
        np.savez(folder / "labels.npz", labels=rows[:, 3], t=rows[:, 0], x=rows[:, 1], y=rows[:, 2])
        np.savetxt(folder / "labels.csv", rows, fmt="%d", delimiter=",", header="t,x,y,label", comments="")
        np.savetxt(folder / "order.csv", rows[:, 3], fmt="%d")
        files = {path.name: path.read_bytes() for path in folder.iterdir()}
        run = {**_pair(folder, ids, rows), "objects.csv": _velocities().encode()}
    pictures = {f"{t_us:012d}.png": cv2.imencode(".png", ids[k])[1].tobytes() for k, t_us in enumerate(CENTRES_US)}
    listed = {f"{k}.png": content for k, content in enumerate(pictures.values())}
    times = "".join(f"{k}.png,{t_us}\n" for k, t_us in enumerate(CENTRES_US)).encode()
    alone = {name: ({name: content}, name) for name, content in files.items()}
    return alone | {
        "run": (run, ""),
        "estimates.h5": (run, "estimates.h5"),
        "events.h5": (run, "events.h5"),
        "pictures": (pictures, ""),
        "pictures by a list": (listed | {"times.csv": times}, ""),
    }


def _labelled(k: int) -> NDArray[np.int64]:
    """Time, column, row and object of each event of a slice."""
    events = events_in(k)
    return np.stack((events.t, events.x, events.y, ids_at(k)[events.y, events.x]), axis=1).astype(np.int64)


def _pair(folder: Path, ids: NDArray[np.uint8], rows: NDArray[np.int64]) -> dict[str, bytes]:
    """The two files of maps and of events that `evimo run` leaves."""
    told = {"recording": "a", "model": "tiny", "model_sha256": "0123"}
    with h5py.File(folder / "estimates.h5", "w") as file:
        file.attrs.update(told)
        file["t_us"], file["ids"] = CENTRES_US, ids
        file["moving_probability"] = np.where(ids > 0, 200, 3).astype(np.uint8)
        file["rel_depth"] = np.where(ids > 0, 0.5, 1).astype(np.float16)
        file["ego"] = np.tile([0.15, 0, 0, 0, 0.2, 0], (SLICES, 1))
        file["has_events"], file["valid"] = np.ones(SLICES, bool), np.ones(SIZE, bool)
    with h5py.File(folder / "events.h5", "w") as file:
        file.attrs.update(told)
        for name, column in zip(("t_us", "x", "y", "object"), rows.T, strict=True):
            file.create_dataset(name, data=column, chunks=(512,), compression="gzip")
    return {name: (folder / name).read_bytes() for name in ("estimates.h5", "events.h5")}


def _velocities() -> str:
    head = "t_us,object,x0,y0,x1,y1,area_px,centroid_x,centroid_y,rel_distance,rel_vx,rel_vy,rel_vz\n"
    return head + "".join(f"{t_us},1,3,5,14,14,120,9,9,0.5,0.1,0,0\n" for t_us in CENTRES_US)
