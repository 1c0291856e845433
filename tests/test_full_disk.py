"""Everything that writes, on a disk that is full after a few kB: one error that names the file, and nothing is left.

A limit of the size of files stands for the disk: filling a real one takes root.
"""

import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from evimo.errors import BadInput
from evimo.evaluation.report import Report
from evimo.events.events import Events
from evimo.formats.saving import save_events
from evimo.geometry.camera import Camera
from evimo.recordings.evimo1_writer import Evimo1Writer
from evimo.recordings.hdf5_writer import Hdf5Writer
from evimo.recordings.pose_track import PoseTrack
from evimo.recordings.prepared import prepare
from evimo.recordings.truth import Truth
from evimo.recordings.writer import RecordingWriter
from evimo.viewing.picture import save_picture
from evimo.viewing.video import whole_video
from evimo.writing import save_files, save_text

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no limits of files there")

ROOM = 6000  # bytes
SIZE = (48, 64)
CAMERA = Camera(fx=50.0, fy=50.0, cx=31.5, cy=23.5, height=SIZE[0], width=SIZE[1])
NOISE = np.random.default_rng(0).integers(0, 255, (*SIZE, 3), np.uint8)


@contextmanager
def full_after(room: int) -> Generator[None]:
    """No file can grow beyond so many bytes."""
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def some_events(index: int) -> Events:
    draw, count = np.random.default_rng(index), 2000
    t = index * 25_000 + np.sort(draw.integers(0, 25_000, count))
    x, y = draw.integers(0, SIZE[1], count), draw.integers(0, SIZE[0], count)
    return Events(x.astype(np.uint16), y.astype(np.uint16), t, draw.choice([-1, 1], count).astype(np.int8))


def truth_at(t_us: int) -> Truth:
    depth = np.random.default_rng(t_us).uniform(1, 3, SIZE).astype(np.float32)
    nothing = np.zeros(SIZE, np.bool_)
    return Truth(t_us, depth, ~nothing, nothing.astype(np.uint8), nothing, np.zeros(6), {})


def at_rest(times_us):
    still = np.tile(np.eye(4), (len(times_us), 1, 1))
    return PoseTrack(times_us, still, np.zeros(0, np.uint8), np.zeros((len(times_us), 0, 4, 4)))


def record(path: Path, writer: type[RecordingWriter] | type[Evimo1Writer] | type[Hdf5Writer]) -> None:
    with writer(path, CAMERA, poses=at_rest) as recording:
        for index in range(3):
            recording.write(some_events(index), truth_at(index * 25_000 + 12_500))


def film(path: Path) -> None:
    with whole_video(path, fps=25) as video:
        for k in range(50):
            video.write(np.roll(NOISE, 7 * k, axis=1))


def save_weights(path: Path) -> None:
    torch = pytest.importorskip("torch")
    from evimo.model.checkpoint import save_tensors

    save_tensors({"weight": torch.rand(100, 100)}, path)


def save_window(path: Path) -> None:
    pytest.importorskip("rerun", reason="needs rerun-sdk: pip install 'evimo[view]'")
    from evimo.viewing.window.store import new_store

    with new_store(path, name="noise", fix="another disk") as store:
        for k in range(50):
            store.log("noise", store.rr.Image(np.roll(NOISE, 7 * k, axis=1)), t_us=25_000 * k)
            store.finished_slice()


WRITERS: dict[str, Callable[[Path], object]] = {
    "recording": lambda path: record(path, RecordingWriter),
    "recording.npz": lambda path: record(path, Evimo1Writer),
    "recording.h5": lambda path: record(path, Hdf5Writer),
    "events.raw": lambda path: save_events(map(some_events, range(3)), path, size=SIZE),
    "events.aedat4": lambda path: save_events(map(some_events, range(40)), path, size=SIZE),
    "report.json": lambda path: Report(settings={"model": "small" * 2000}).save(path),
    "picture.png": lambda path: save_picture(NOISE, path),
    "video.mp4": film,
    "window.rrd": save_window,
    "weights.safetensors": save_weights,
    "text.md": lambda path: save_text("text" * 2000, path),
}


@pytest.mark.parametrize("name", WRITERS)
def test_nothing_is_left_and_the_file_is_named(name, tmp_path):
    path = tmp_path / "new" / name
    with full_after(ROOM), pytest.raises(BadInput, match=f"cannot write {path}: .*\n  try: ") as raised:
        WRITERS[name](path)
    assert len(str(raised.value).splitlines()) == 2
    assert list(tmp_path.iterdir()) == []
    WRITERS[name](path)
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("name", sorted(WRITERS.keys() - {"recording", "recording.npz", "recording.h5"}))
def test_what_was_there_before_stays(name, tmp_path):
    path = tmp_path / name
    path.write_text("old")
    with full_after(ROOM), pytest.raises(BadInput):
        WRITERS[name](path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_files_of_one_command_stay_together(tmp_path):
    save_files(tmp_path, {"a.json": "old", "b.md": "old"})
    with full_after(ROOM), pytest.raises(BadInput, match=f"cannot write {tmp_path}"):
        save_files(tmp_path, {"a.json": "new", "b.md": "new" * 4000})
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a.json": "old", "b.md": "old"}


def test_what_training_prepares_is_whole_or_not_there(tmp_path):
    folder = tmp_path / "recording"
    record(folder, RecordingWriter)
    before = sorted(folder.iterdir())
    with full_after(ROOM), pytest.raises(BadInput, match=f"cannot write {folder}/prepared_v1: File too large"):
        prepare(folder)
    assert sorted(folder.iterdir()) == before
    assert prepare(folder).exists()
