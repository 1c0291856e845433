"""One simulation in both layouts says the same, opened as the users of each would open it."""

import itertools
import json

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evimo.events.events import joined
from evimo.formats import open_events
from evimo.recordings.recording import open_recording
from evimo.scene.renderer import Renderer
from evimo.simulate.dataset import DatasetPlan, simulate_dataset
from evimo.simulate.plan import RecordingPlan
from evimo.simulate.recording import simulate_recording

ELSEWHERE = ("sim_facts", "sim_clutter", "sim_event_ids")  # files of their own in a folder


HOW = {"set_number": 3, "seconds": 0.1, "camera": "evimo", "size": (65, 86)}


@pytest.fixture(scope="module")
def seed():
    """The first one from which three objects are seen."""
    for seed in range(200):
        recording = simulate_recording(RecordingPlan(seed=seed, **HOW))
        ids = Renderer(recording.scene, recording.camera).truth(50_000).ids
        if all((ids == id_).sum() > 60 for id_ in (1, 2, 3)):
            return seed
    raise AssertionError("no scene with three objects in view")


def made(out, layout, seed):
    plan = DatasetPlan(first=RecordingPlan(seed=seed, **HOW), minutes=0.1 / 60, layout=layout)
    return next(iter(simulate_dataset(plan, out)))


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return tmp_path_factory.mktemp("both")


@pytest.fixture(scope="module")
def folder(out, seed):
    return made(out, "evimo2", seed)


@pytest.fixture(scope="module")
def file(out, seed):
    return made(out, "evimo1", seed)


@pytest.fixture(scope="module")
def stored(file):
    with np.load(file, allow_pickle=False) as archive:
        return dict(archive)


def matrix(pose):
    rigid = np.eye(4)
    rigid[:3, :3] = Rotation.from_quat([pose["q"][axis] for axis in "xyzw"]).as_matrix()
    rigid[:3, 3] = [pose["t"][axis] for axis in "xyz"]
    return rigid


def test_the_events_are_the_same(folder, file):
    one, two = (open_events(path) for path in (folder, file))
    assert (one.sensor, one.start_us, one.stop_us) == (two.sensor, two.start_us, two.stop_us)
    whole, other = joined(list(one)), joined(list(two))
    assert len(whole) > 1000
    for name in ("x", "y", "t", "p"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(other, name))


def test_the_truth_is_the_same(folder, stored):
    recording = open_recording(folder)
    assert len(recording) == len(stored["depth"]) == 4
    for k in range(len(recording)):
        truth = recording.truth(k)
        np.testing.assert_array_equal(truth.depth, stored["depth"][k] * np.float32(1e-3))
        np.testing.assert_array_equal(truth.ids, stored["mask"][k] / 1000)
        np.testing.assert_array_equal(recording.clutter_bodies(k), stored["sim_clutter"][k])
    with np.load(folder / "dataset_sim.npz", allow_pickle=False) as sim:
        assert sorted(f"sim_{name}" for name in sim) == sorted(
            name for name in stored if name.startswith("sim_") and name not in ELSEWHERE and "imu" not in name
        )
        for name, values in sim.items():
            np.testing.assert_array_equal(values, stored[f"sim_{name}"])
    for name, values in recording.imu.arrays().items():
        np.testing.assert_array_equal(values, stored[f"sim_imu_{name}"])
    np.testing.assert_array_equal(recording.event_ids, stored["sim_event_ids"])
    assert set(stored["sim_event_ids"].tolist()) <= {0, 1, 2, 3}
    assert (stored["sim_event_ids"] > 0).sum() > 20
    assert json.loads(stored["sim_facts"].item()) == json.loads(json.dumps(recording.meta))


def test_poses_in_v1_axes_come_back_to_those_of_the_folder(folder, stored):
    """A v1 camera's x is up, y left, z backward: each axis is named, none is multiplied."""
    mine = json.loads((folder / "dataset_info.json").read_text())["meta"]["frames"]
    v1 = json.loads(stored["meta"].item())["frames"]
    assert [frame["ts"] for frame in v1] == [frame["ts"] for frame in mine]
    for old, new in zip(v1, mine, strict=True):
        assert old.keys() == new.keys()
        assert {"cam", "1", "2", "3"} < old.keys()
        for name in ("1", "2", "3"):
            up, left, backward, _ = matrix(old[name]["pos"])
            np.testing.assert_allclose(np.stack((-left, -up, -backward)), matrix(new[name]["pos"])[:3], atol=1e-8)
        up, left, backward, _ = matrix(old["cam"]["pos"])
        right, down, forward = (
            np.array([-row[1], -row[0], -row[2], row[3]]) for row in (-left, -up, -backward)
        )  # columns likewise; the last one is a place
        np.testing.assert_allclose(np.stack((right, down, forward)), matrix(new["cam"]["pos"])[:3], atol=1e-8)


def test_v1_objects_are_found_again_through_their_poses_and_the_calibration(stored):
    """Points of an object's mask and depth, moved with its pose, lie on the mask and depth of the next instant.

    Through OpenCV, with K and D as they are in the file: what a user would do, and how a wrong axis would show.
    """
    frames, lens = json.loads(stored["meta"].item())["frames"], (stored["K"], stored["D"])
    found, wrong = [], []
    for k, (now, after) in enumerate(itertools.pairwise(frames)):
        for name in ("1", "2", "3"):
            rows, columns = np.nonzero(stored["mask"][k] == 1000 * int(name))
            rays = cv2.undistortPoints(np.stack((columns, rows), axis=1).astype(float)[:, None], *lens)[:, 0]
            depth = stored["depth"][k][rows, columns] / 1000
            right, down, forward = *(rays * depth[:, None]).T, depth
            points = np.stack((-down, -right, -forward, np.ones_like(depth)))
            onwards = matrix(after[name]["pos"]) @ np.linalg.inv(matrix(now[name]["pos"]))
            for move, hits in ((onwards, found), (np.linalg.inv(onwards), wrong)):
                up, left, backward, _ = move @ points
                there = np.stack((-left, -up, -backward), axis=1)
                seen = np.rint(cv2.projectPoints(there, np.zeros(3), np.zeros(3), *lens)[0][:, 0]).astype(int)
                inside = ((seen >= 0) & (seen < (86, 65))).all(axis=1)
                x, y = seen[inside].T
                hits += (np.abs(stored["depth"][k + 1][y, x] / 1000 + backward[inside]) < 0.02).tolist()
    assert len(found) > 500
    assert np.mean(found) > 0.85
    assert np.mean(wrong) < np.mean(found) - 0.1
