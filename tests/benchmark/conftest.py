"""Recordings made by hand, and models that know their truth, or half of it."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.benchmark.written import MODELS

from evimo.errors import NotFound
from evimo.events.events import Events
from evimo.geometry.camera import Camera
from evimo.recordings.estimate import Estimate
from evimo.recordings.flow import true_flow
from evimo.recordings.pose_track import PoseTrack
from evimo.recordings.recording import open_recording
from evimo.recordings.truth import ObjectTruth, Truth
from evimo.recordings.writer import RecordingWriter

CAMERA = Camera(fx=40.0, fy=40.0, cx=19.5, cy=14.5, height=30, width=40)
EGO = np.array([0.3, 0, 0.4, 0, 0.2, 0])
SLICES = 4


def truth_at(t_us: int, *, movers: bool) -> Truth:
    """A wall at 2 m and before it, if anything moves, a square of 10x10 pixels at 1 m that moves 0.2 m/s."""
    ids = np.zeros(CAMERA.size, np.uint8)
    if movers:
        ids[10:20, 10:20] = 1
    depth = np.where(ids == 1, 1.0, 2.0).astype(np.float32)
    mover = ObjectTruth(np.array([0, 0, 1.0]), np.array([0.2, 0, 0]), np.zeros(3))
    everywhere, nowhere = np.ones(CAMERA.size, bool), np.zeros(CAMERA.size, bool)
    return Truth(t_us, depth, everywhere, ids, nowhere, EGO, {1: mover} if movers else {})


def events_in(k: int) -> Events:
    """One event per pixel, spread over slice k."""
    y, x = (each.ravel() for each in np.mgrid[: CAMERA.height, : CAMERA.width])
    t = k * 25_000 + np.linspace(0, 24_999, len(x)).astype(np.int64)
    return Events(x.astype(np.uint16), y.astype(np.uint16), t, np.ones(len(x), np.int8))


def at_rest(times_us):
    still = np.tile(np.eye(4), (len(times_us), 1, 1))
    return PoseTrack(times_us, still, np.array([1], np.uint8), still[:, None])


def save_recording(folder: Path, *, background: str | None, seed: int = 0) -> Path:
    """A recording that says its background, if it does."""
    facts = {"set": 2, "seed": seed} | ({} if background is None else {"background": background})
    with RecordingWriter(folder, CAMERA, facts=facts, poses=at_rest) as writer:
        for k in range(SLICES):
            truth = truth_at(k * 25_000 + 12_500, movers=background != "planar")
            writer.write(events_in(k), truth, event_ids=truth.ids[events_in(k).y, events_in(k).x])
    return folder


def knowing(path: Path) -> Iterator[Estimate]:
    """What a perfect model says: all velocities and depths in units of 2 m, but no object velocity."""
    recording = open_recording(path)
    grid = (np.mgrid[: CAMERA.height, : CAMERA.width][::-1] - np.array([[[19.5]], [[14.5]]])) / 40
    for k in range(len(recording)):
        truth = recording.truth(k)
        yield Estimate(
            t_us=truth.t_us,
            start_us=k * 25_000,
            stop_us=(k + 1) * 25_000,
            moving_probability=(truth.ids > 0).astype(np.float32),
            ids=truth.ids,
            rel_depth=truth.depth / 2,
            flow=true_flow(truth, grid).astype(np.float32),
            confidence=np.ones(CAMERA.size, np.float32),
            valid=np.ones(CAMERA.size, bool),
            ego=truth.ego * [0.5, 0.5, 0.5, 1, 1, 1],
            objects=(),
        )


def half_knowing(path: Path) -> Iterator[Estimate]:
    """One that misses half of the object, calls a row of the wall moving, and does not see the camera turn."""
    for estimate in knowing(path):
        probability = estimate.moving_probability.copy()
        probability[:15] *= 0.2
        probability[25] = 0.9
        ego = estimate.ego * [1, 1, 1, 0, 0, 0]
        yield replace(estimate, moving_probability=probability, rel_depth=np.ones(CAMERA.size, np.float32), ego=ego)


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str]]:
    """Replaces the networks `perfect`, `half` and `_mine` by these; lists the model and the recording of each run."""
    done: list[tuple[str, str]] = []
    models = {"perfect": knowing, "half": half_knowing, "_mine": knowing}

    def run(events, *, model, camera, imu, start_s=0.0, stop_s=None):
        assert imu == "off"
        first, last = round(start_s * 40), SLICES if stop_s is None else round(stop_s * 40)
        if stop_s is None:
            done.append((model, events.path.name))
        return (each for k, each in enumerate(models[model](events.path)) if first <= k < last)

    class Network:
        def __init__(self, name):
            if name not in models:
                raise NotFound(f"no model {name!r}", fix="another")
            self.identity = {"sha256": f"digest of {name}"}

    monkeypatch.setattr("evimo.benchmark.scoring.run", run)
    monkeypatch.setattr("evimo.benchmark.worst.run", run)
    monkeypatch.setattr("evimo.benchmark.cases.model_of", Network)
    return done


@pytest.fixture
def recordings(tmp_path: Path) -> Path:
    """A folder with two recordings of a wall, one of a table and a planar one."""
    for k, (name, background) in enumerate([("a", "wall"), ("b", "wall"), ("c", "table"), ("d", "planar")]):
        save_recording(tmp_path / "set" / background / name, background=background, seed=7 + k)
    return tmp_path / "set"


@pytest.fixture
def saved() -> Callable[..., Path]:
    """Saves a recording."""
    return save_recording


@pytest.fixture
def command(runs, recordings, tmp_path) -> list[str]:
    return ["benchmark", "--data", str(recordings), "--out", str(tmp_path / "out"), *MODELS]


@pytest.fixture
def no_page(monkeypatch) -> None:
    """Leaves out the page, which takes a second."""
    monkeypatch.setattr("evimo.benchmark.running.as_html", lambda result: "")
