"""A small recording that moves along x, and Rerun files read back."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evimo.events.events import Events
from evimo.geometry.camera import Camera
from evimo.recordings.pose_track import PoseTrack
from evimo.recordings.truth import ObjectTruth, Truth
from evimo.recordings.writer import RecordingWriter

NEEDS_RERUN = "needs rerun-sdk: pip install 'evimo[view]'"
SIZE = (24, 32)
CAMERA = Camera(30.0, 30.0, 15.5, 11.5, *SIZE)
SLICES = 6
SPEED = 0.8  # m/s, of the camera along the world's x
WORLD_FROM_START = np.array([[1.0, 0, 0, 0.5], [0, 0, 1, -2], [0, -1, 0, 1.25], [0, 0, 0, 1]])
"""The camera looks along the world's y, its own y downwards."""
THING = np.array((0.1, -0.2, 1.0))
"""Where object 1 is, camera axes; it goes along with the camera."""


def poses(times_us: np.ndarray) -> PoseTrack:
    world_from_cam = np.tile(WORLD_FROM_START, (len(times_us), 1, 1))
    world_from_cam[:, 0, 3] += SPEED * times_us * 1e-6
    cam_from_object = np.tile(np.eye(4), (len(times_us), 1, 1, 1))
    cam_from_object[..., :3, 3] = THING
    return PoseTrack(times_us, world_from_cam, np.array([1], np.uint8), cam_from_object)


def true_instant(k: int) -> Truth:
    ids = np.zeros(SIZE, np.uint8)
    ids[8:16, 4 + k : 14 + k] = 1
    depth = np.where(ids, 1, 2).astype(np.float32)
    depth[0, :] = 0  # unknown
    one = ObjectTruth(THING, np.array((0.4, 0, 0)), np.zeros(3))
    ego = np.array((SPEED, 0, 0, 0, 0, np.radians(30)))
    return Truth(k * 25_000 + 12_500, depth, depth > 0, ids, ids > 1, ego, {1: one})


def events_of(k: int) -> Events:
    """Three events in one pixel, the last one OFF, and one ON in another."""
    t = k * 25_000 + np.arange(100, 500, 100)
    x, y = np.array([3, 3, 3, 20], np.uint16), np.array([5, 5, 5, 7], np.uint16)
    return Events(x, y, t, np.array([1, 1, -1, 1], np.int8))


@pytest.fixture
def film(tmp_path: Path) -> Path:
    with RecordingWriter(tmp_path / "film", CAMERA, poses=poses, facts={"seed": 1}) as writer:
        for k in range(SLICES):
            writer.write(events_of(k), true_instant(k))
    return tmp_path / "film"


class ReadBack:
    """A Rerun file, read by Rerun's own reader."""

    def __init__(self, path: Path) -> None:
        pytest.importorskip("rerun", reason=NEEDS_RERUN)
        from rerun.chunk import RrdReader

        self.reader = RrdReader(path)
        self.chunks: dict[str, list[Any]] = {}
        for chunk in self.reader.stream().to_chunks():
            self.chunks.setdefault(chunk.entity_path, []).append(chunk)

    def rows(self, entity: str, component: str) -> dict[int | None, Any]:
        """The values of a component by time in µs; None is all times."""
        found: dict[int | None, Any] = {}
        for chunk in self.chunks[f"/{entity}"]:
            batch = chunk.to_record_batch()
            if component not in batch.schema.names:
                continue
            column = batch.column(component).to_pylist()
            times = [None] * len(column) if chunk.is_static else batch.column("time").cast("int64").to_pylist()
            found |= {None if time is None else time // 1000: value for time, value in zip(times, column, strict=True)}
        return found


@pytest.fixture
def read_back() -> Callable[[Path], ReadBack]:
    return ReadBack
