"""The same recording in both layouts, opened through the same door."""

import io
import zipfile

import numpy as np
import pytest

from evimo.errors import BadFile
from evimo.events.events import joined
from evimo.recordings.evimo1_writer import Evimo1Writer
from evimo.recordings.imu import Imu
from evimo.recordings.pose_track import PoseTrack
from evimo.recordings.recording import open_recording
from evimo.recordings.writer import RecordingWriter

IMU = Imu(np.arange(75) * 1000, *np.random.default_rng(5).normal(size=(4, 75, 3)).astype(np.float32))


def poses(times_us):
    """A camera at rest, and two objects at its place."""
    still = np.tile(np.eye(4), (len(times_us), 1, 1))
    return PoseTrack(times_us, still, np.array([1, 2], np.uint8), np.stack((still, still), axis=1))


def saved(writer, pieces):
    rng = np.random.default_rng(0)
    with writer:
        for events, truth in pieces:
            bodies = (truth.clutter * rng.integers(1, 5, truth.clutter.shape)).astype(np.uint8)
            ids = (np.arange(len(events)) % 3).astype(np.uint8)
            writer.write(events, truth, clutter_bodies=bodies, event_ids=ids)


@pytest.fixture
def file(tmp_path, camera, pieces):
    how = {"poses": poses, "facts": {"seed": 3, "set": 2}, "imu": IMU}
    saved(Evimo1Writer(tmp_path / "film.npz", camera, **how), pieces)
    saved(RecordingWriter(tmp_path / "film", camera, **how), pieces)
    return tmp_path / "film.npz"


def test_both_layouts_say_the_same(file, camera):
    one, two = open_recording(file.with_suffix("")), open_recording(file)
    assert one.camera == two.camera == camera
    assert one.meta == two.meta
    assert two.meta["seed"] == 3
    assert two.path == file
    assert len(two) == 3
    np.testing.assert_array_equal(one.times_us, two.times_us)
    np.testing.assert_array_equal(one.event_ids, two.event_ids)
    assert len(two.event_ids) == 80
    for name, values in one.imu.arrays().items():
        np.testing.assert_array_equal(getattr(two.imu, name), values)
    for each in (one, two):
        assert each.events.contents["object ids"] == "of 80 events"
        assert each.events.contents["IMU"] == "75 samples"
    whole, other = joined(list(one.events)), joined(list(two.events))
    for name in ("x", "y", "t", "p"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(other, name))


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1), (1, 1, 0)])
def test_truth_is_found_in_any_order(file, order):
    one, two = open_recording(file.with_suffix("")), open_recording(file)
    for k in order:
        mine, other = one.truth(k), two.truth(k)
        assert mine.t_us == other.t_us
        for name in ("depth", "valid", "ids", "clutter", "ego"):
            np.testing.assert_array_equal(getattr(mine, name), getattr(other, name))
        assert mine.objects.keys() == other.objects.keys()
        for id_, moved in mine.objects.items():
            np.testing.assert_array_equal(moved.velocity, other.objects[id_].velocity)
        np.testing.assert_array_equal(one.clutter_bodies(k), two.clutter_bodies(k))


def rewritten(file, **changes):
    """The file with other arrays, or, where None, without them."""
    with np.load(file) as stored:
        arrays = {**stored, **changes}
    path = file.with_name("other.npz")
    np.savez(path, **{name: values for name, values in arrays.items() if values is not None})
    return path


def test_what_no_simulator_wrote_is_told_from_a_damaged_file(file):
    """Events, maps and no `meta`: another program's file, which holds no motion."""
    real = rewritten(file, sim_facts=None, sim_ego=None, sim_times_us=None, meta=None)
    with pytest.raises(BadFile, match=r"holds no truth[\s\S]*evimo run"):
        open_recording(real)


@pytest.mark.parametrize("name", ["depth", "mask", "sim_clutter"])
def test_maps_that_are_missing_or_do_not_fit_are_refused(file, name):
    for wrong in (None, np.zeros((2, 8, 12), np.uint16), np.zeros((3, 8, 11), np.uint16), np.zeros(4, np.uint16)):
        recording = open_recording(rewritten(file, **{name: wrong}))
        with pytest.raises(BadFile, match=name.removeprefix("sim_")):
            recording.truth(2)


def test_ids_and_motions_that_do_not_fit_are_refused(file):
    with pytest.raises(BadFile, match="ids of events"):
        _ = open_recording(rewritten(file, sim_event_ids=np.zeros(79, np.uint8))).event_ids
    assert open_recording(rewritten(file, sim_event_ids=None)).event_ids is None
    assert open_recording(rewritten(file, sim_imu_t_us=None)).imu is None
    with pytest.raises(BadFile, match="sim_ego"):
        open_recording(rewritten(file, sim_ego=None))
    with pytest.raises(BadFile, match="sim"):
        open_recording(rewritten(file, sim_ego=np.zeros((2, 6))))


def test_a_file_cut_short_is_a_bad_file(file):
    short = file.with_name("short.npz")
    short.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    with pytest.raises(BadFile, match=r"short\.npz"):
        open_recording(short)


def repacked(path, changes):
    """An archive with some members replaced, their check sums right."""
    with zipfile.ZipFile(path) as old:
        members = {name: old.read(name) for name in old.namelist()} | changes
    with zipfile.ZipFile(path, "w") as new:
        for name, content in members.items():
            new.writestr(name, content)


def npy(values):
    file = io.BytesIO()
    np.save(file, values)
    return file.getvalue()


@pytest.mark.parametrize(
    "content", [b"plain bytes", npy(np.array("words")), npy(np.float64(3)), b"\x93NUMPY\x01\0\x08\0{'desc\n\n"]
)
def test_a_member_that_is_no_array_of_numbers_is_a_bad_file(file, content):
    folder = file.with_suffix("")
    repacked(folder / "dataset_clutter.npz", {"clutter_0000000001.npy": content})
    recording = open_recording(folder)
    recording.truth(0)
    with pytest.raises(BadFile, match="clutter"):
        recording.truth(1)
    repacked(folder / "dataset_imu.npz", {"gyro.npy": content})
    with pytest.raises(BadFile, match=r"gyro|IMU"):
        _ = recording.imu
    for name in ("times_us", "ego", "object_ids"):
        broken = file.with_name(f"{name}.npz")
        broken.write_bytes(file.read_bytes())
        repacked(broken, {f"sim_{name}.npy": content})
        with pytest.raises(BadFile, match=name):
            open_recording(broken)
