import json
import zipfile

import numpy as np
import pytest

from evimo.errors import BadFile, BadInput, NotFound
from evimo.events.events import joined
from evimo.formats import open_events
from evimo.recordings.imu import Imu
from evimo.recordings.prepared import prepare
from evimo.recordings.recording import open_recording
from evimo.recordings.writer import RecordingWriter


@pytest.fixture
def folder(tmp_path, camera, pieces):
    with RecordingWriter(tmp_path / "film", camera, facts={"seed": 3}) as writer:
        for events, truth in pieces:
            writer.write(events, truth)
    return tmp_path / "film"


def test_what_was_written_is_read_back(folder, camera, pieces):
    recording = open_recording(folder)
    assert recording.camera == camera
    assert recording.meta["seed"] == 3
    assert recording.times_us.tolist() == [12_500, 37_500, 62_500]
    assert len(recording) == 3
    for k, (_, truth) in enumerate(pieces):
        read = recording.truth(k)
        assert read.t_us == truth.t_us
        np.testing.assert_allclose(read.depth, truth.depth, atol=0.00051)  # whole millimetres
        for name in ("valid", "ids", "clutter", "ego"):
            np.testing.assert_array_equal(getattr(read, name), getattr(truth, name))
        assert read.objects.keys() == truth.objects.keys()
        for id_, moved in truth.objects.items():
            for name in ("position", "velocity", "rotation"):
                np.testing.assert_array_equal(getattr(read.objects[id_], name), getattr(moved, name))


def test_events_are_the_same_through_both_doors(folder, camera, pieces):
    expected = joined([events for events, _ in pieces])
    for file in (open_recording(folder).events, open_events(folder)):
        read = joined(list(file))
        assert file.sensor == camera.size
        for name in ("x", "y", "t", "p"):
            np.testing.assert_array_equal(getattr(read, name), getattr(expected, name))
    late = joined(list(open_recording(folder).events.packets(50_000, 75_000)))
    np.testing.assert_array_equal(late.t, pieces[2][0].t)


def test_microseconds_survive_float_seconds_for_hours(tmp_path, camera, pieces):
    events, truth = pieces[0]
    events.t[:] += 36_000_000_000
    with RecordingWriter(tmp_path / "late", camera) as writer:
        writer.write(events, truth)
    np.testing.assert_array_equal(joined(list(open_recording(tmp_path / "late").events)).t, events.t)


def test_clutter_bodies_are_numbered(tmp_path, camera, pieces):
    bodies = np.arange(96, dtype=np.uint8).reshape(8, 12) % 4
    with RecordingWriter(tmp_path / "film", camera) as writer:
        writer.write(*pieces[0], clutter_bodies=bodies)
    recording = open_recording(tmp_path / "film")
    np.testing.assert_array_equal(recording.clutter_bodies(0), bodies)
    np.testing.assert_array_equal(recording.truth(0).clutter, bodies > 0)


def test_ids_of_events_are_read_back_mapped_and_are_as_many(tmp_path, folder, camera, pieces):
    given = [np.arange(len(events), dtype=np.uint8) % 3 for events, _ in pieces]
    with RecordingWriter(tmp_path / "labelled", camera) as writer:
        for (events, truth), ids in zip(pieces, given, strict=True):
            writer.write(events, truth, event_ids=ids)
    found = open_recording(tmp_path / "labelled").event_ids
    assert isinstance(found, np.memmap)
    np.testing.assert_array_equal(found, np.concatenate(given))
    assert open_events(tmp_path / "labelled").contents["object ids"] == "of 80 events"
    assert open_recording(folder).event_ids is None
    with pytest.raises(ValueError, match="1 ids of 50"), RecordingWriter(tmp_path / "b", camera) as writer:
        writer.write(*pieces[0], event_ids=np.zeros(1, np.uint8))


@pytest.mark.parametrize("wrong", [np.zeros(79, np.uint8), np.zeros((80, 1), np.uint8), np.zeros(80), np.array([{}])])
def test_ids_that_do_not_fit_the_events_are_refused(folder, wrong):
    np.save(folder / "dataset_events_id.npy", wrong)
    with pytest.raises(BadFile, match=r"ids of events|dataset_events_id"):
        _ = open_recording(folder).event_ids


def test_a_recording_is_told_from_itself_once_a_file_has_changed(folder):
    mark = open_recording(folder).mark
    prepare(folder)  # adds files that say nothing new
    (folder / ".unfinished-0").mkdir()
    (folder / ".unfinished-0" / "file").touch()
    assert open_recording(folder).mark == mark
    for name in ("dataset_mask.npz", "dataset_events_t.npy", "dataset_depth.npz"):
        changed = folder / name
        content = changed.read_bytes()
        changed.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))  # as long as before
        marks = {mark, open_recording(folder).mark}
        assert len(marks) == 2
        mark = open_recording(folder).mark


@pytest.fixture
def imu():
    rng = np.random.default_rng(5)
    return Imu(np.arange(75) * 1000, *rng.normal(size=(4, 75, 3)).astype(np.float32))


def test_what_the_imu_says_is_read_back_without_a_pickle(tmp_path, folder, camera, pieces, imu):
    with RecordingWriter(tmp_path / "moved", camera, imu=imu) as writer:
        writer.write(*pieces[0])
    assert open_events(tmp_path / "moved").contents["IMU"] == "75 samples"
    read = open_recording(tmp_path / "moved").imu
    assert len(read) == 75
    assert read.t_us.dtype == np.int64
    for name, values in imu.arrays().items():
        np.testing.assert_array_equal(getattr(read, name), values)
    assert open_recording(folder).imu is None


def test_imu_arrays_that_do_not_fit_are_refused(folder, imu):
    for wrong in ({"gyro": imu.gyro[:-1]}, {"accel": imu.accel[:, :2]}, {"t_us": np.array([imu], dtype=object)}):
        np.savez(folder / "dataset_imu.npz", **imu.arrays() | wrong)
        with pytest.raises(BadFile, match=r"IMU|dataset_imu"):
            _ = open_recording(folder).imu


def test_nothing_is_pickled_and_the_layout_is_evimo2s(folder):
    assert {file.name for file in folder.iterdir()} == {
        *(f"dataset_events_{name}.npy" for name in ("t", "xy", "p")),
        *(f"dataset_{name}.npz" for name in ("depth", "mask", "clutter", "sim")),
        "dataset_info.json",
    }
    assert np.load(folder / "dataset_events_t.npy").dtype == np.float64
    assert np.load(folder / "dataset_events_xy.npy").dtype == np.uint16
    assert set(np.load(folder / "dataset_events_p.npy").tolist()) == {0, 1}
    with np.load(folder / "dataset_mask.npz") as masks:
        assert sorted(masks) == [f"mask_{k:010d}" for k in range(3)]
        assert set(np.unique(masks["mask_0000000000"])) <= {0, 1000, 2000}
    meta = json.loads((folder / "dataset_info.json").read_text())["meta"]["meta"]
    assert (meta["res_x"], meta["res_y"], meta["p2"]) == (12, 8, -0.002)


def test_the_same_recording_gives_the_same_bytes(folder, tmp_path, camera, pieces):
    with RecordingWriter(tmp_path / "again", camera, facts={"seed": 3}) as writer:
        for events, truth in pieces:
            writer.write(events, truth)
    for file in folder.iterdir():
        assert file.read_bytes() == (tmp_path / "again" / file.name).read_bytes()


def test_what_breaks_off_leaves_nothing(tmp_path, camera, pieces):
    with pytest.raises(KeyboardInterrupt), RecordingWriter(tmp_path / "film", camera) as writer:
        writer.write(*pieces[0])
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_exists_is_not_overwritten(folder, camera):
    with pytest.raises(BadInput, match="exists"):
        RecordingWriter(folder, camera)


def test_no_folder_is_not_found(tmp_path):
    with pytest.raises(NotFound, match="evimo simulate"):
        open_recording(tmp_path / "nothing")


@pytest.mark.parametrize("name", ["info.json", "sim.npz"])
@pytest.mark.parametrize("damage", ["gone", "empty", "short", "noise"])
def test_a_damaged_folder_is_a_bad_file(folder, name, damage):
    _damage(folder / f"dataset_{name}", damage)
    with pytest.raises(BadFile, match=name):
        open_recording(folder)


@pytest.mark.parametrize("name", ["depth", "mask", "clutter"])
@pytest.mark.parametrize("damage", ["gone", "empty", "short", "noise"])
def test_a_damaged_map_is_a_bad_file(folder, name, damage):
    _damage(folder / f"dataset_{name}.npz", damage)
    recording = open_recording(folder)
    with pytest.raises(BadFile, match=name):
        for k in range(3):
            recording.truth(k)


def _damage(path, damage):
    content = path.read_bytes()
    if damage == "gone":
        path.unlink()
    elif damage == "empty":
        path.write_bytes(b"")
    elif damage == "short":
        path.write_bytes(content[: len(content) // 2])
    else:
        path.write_bytes(bytes(len(content)))


def test_arrays_that_do_not_fit_together_are_a_bad_file(folder):
    with np.load(folder / "dataset_sim.npz") as stored:
        arrays = dict(stored)
    np.savez(folder / "dataset_sim.npz", **{**arrays, "ego": arrays["ego"][:2]})
    with pytest.raises(BadFile, match="fit together"):
        open_recording(folder)


def test_a_pickle_inside_is_refused(folder):
    with zipfile.ZipFile(folder / "dataset_sim.npz", "w") as archive, archive.open("times_us.npy", "w") as file:
        np.lib.format.write_array(file, np.array([{}], object), allow_pickle=True)
    with pytest.raises(BadFile, match=r"sim\.npz"):
        open_recording(folder)
