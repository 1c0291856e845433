"""A recording of six slices with two movers, one of which leaves, and an event on every pixel in each slice."""

from collections.abc import Callable
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest

from evimo.events.events import Events
from evimo.geometry.camera import Camera
from evimo.recordings.evimo1_writer import Evimo1Writer
from evimo.recordings.pose_track import PoseTrack
from evimo.recordings.recording import Recording, open_recording
from evimo.recordings.truth import ObjectTruth, Truth
from evimo.recordings.writer import RecordingWriter

CAMERA = Camera(fx=40.0, fy=40.0, cx=19.5, cy=14.5, height=30, width=40)
SLICES = 6
CENTRES_US = np.array([12_500 + 25_000 * k for k in range(SLICES)])


def ids_at(k: int) -> np.ndarray:
    """Object 1 is 10x12 pixels and moves a column per slice; object 2 is 8x8, not there from slice 4 on."""
    ids = np.zeros(CAMERA.size, np.uint8)
    ids[5:15, 3 + k : 15 + k] = 1
    if k < 4:
        ids[18:26, 25:33] = 2
    return ids


def events_in(k: int) -> Events:
    rng = np.random.default_rng(k)
    place = rng.permutation(CAMERA.height * CAMERA.width)
    t = k * 25_000 + np.sort(rng.integers(0, 25_000, len(place)))
    y, x = (each.astype(np.uint16) for each in np.divmod(place, CAMERA.width))
    return Events(x, y, t.astype(np.int64), np.ones(len(place), np.int8))


@pytest.fixture
def save_recording() -> Callable[..., Path]:
    def save(folder: Path, writes: type[RecordingWriter] | type[Evimo1Writer] = RecordingWriter) -> Path:
        def at_rest(times_us):
            still = np.tile(np.eye(4), (len(times_us), 1, 1))
            return PoseTrack(times_us, still, np.array([1, 2], np.uint8), np.stack((still, still), axis=1))

        with writes(folder, CAMERA, facts={"set": 4, "seed": 0}, poses=at_rest) as writer:
            for k in range(SLICES):
                ids, events = ids_at(k), events_in(k)
                movers = {key: ObjectTruth(np.array([0, 0, 1.0]), np.array([0.2, 0, 0]), np.zeros(3)) for key in (1, 2)}
                everywhere = np.ones(CAMERA.size, bool)
                depth = np.where(ids > 0, 1.0, 2.0).astype(np.float32)
                truth = Truth(
                    CENTRES_US[k], depth, everywhere, ids, ~everywhere, np.array([0.3, 0, 0, 0, 0.2, 0]), movers
                )
                writer.write(events, truth, event_ids=ids[events.y, events.x])
        return folder

    return save


@pytest.fixture
def recording(save_recording: Callable[..., Path], tmp_path: Path) -> Recording:
    return open_recording(save_recording(tmp_path / "truth" / "a"))


@pytest.fixture
def all_ids() -> np.ndarray:
    """The true ids of every slice, (N, H, W)."""
    return np.stack([ids_at(k) for k in range(SLICES)])


@pytest.fixture
def labelled_rows() -> np.ndarray:
    """Time, column, row and true id of every event, (N, 4)."""
    rows = [
        np.stack((events.t, events.x, events.y, ids_at(k)[events.y, events.x]), axis=1).astype(np.int64)
        for k in range(SLICES)
        for events in [events_in(k)]
    ]
    return np.concatenate(rows)


@pytest.fixture
def truth(recording: Recording) -> Path:
    return recording.path


def save_pictures(folder: Path, pictures, times=CENTRES_US) -> Path:
    folder.mkdir()
    for picture, t_us in zip(pictures, times, strict=True):
        cv2.imwrite(str(folder / f"{t_us:012d}.png"), picture)
    return folder


def save_estimates(path: Path, ids, *, keep=slice(None), **attributes) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    with h5py.File(path, "w") as file:
        file.attrs.update({"recording": "a", "model": "tiny", "model_sha256": "0123"} | attributes)
        file["t_us"], file["ids"] = CENTRES_US[keep], ids[keep].astype(np.uint8)
        file["moving_probability"] = np.where(ids[keep] > 0, 200, 3).astype(np.uint8)
        file["rel_depth"] = np.where(ids[keep] > 0, 0.5, 1).astype(np.float16)
        file["ego"] = np.tile([0.15, 0, 0, 0, 0.2, 0], (len(ids[keep]), 1))
        file["has_events"] = np.ones(len(ids[keep]), bool)
        file["valid"] = np.ones(ids.shape[1:], bool)
    return path


def save_labels(path: Path, rows, heading="t,x,y,label") -> Path:
    np.savetxt(path, rows, fmt="%d", delimiter=",", header=heading, comments="")
    return path


@pytest.fixture(name="save_pictures")
def save_pictures_by_name() -> Callable[..., Path]:
    return save_pictures


@pytest.fixture(name="save_estimates")
def save_estimates_by_name() -> Callable[..., Path]:
    return save_estimates


@pytest.fixture(name="save_labels")
def save_labels_by_name() -> Callable[..., Path]:
    return save_labels
