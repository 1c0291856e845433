"""The first EV-IMO layout, opened as a user would: by NumPy, with pickles forbidden."""

import ast
import json
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evimo.errors import BadInput
from evimo.events.events import Events, joined, no_events
from evimo.formats import open_events
from evimo.geometry.camera import Camera
from evimo.recordings.evimo1_writer import STEP_US, Evimo1Writer, TimeIndex
from evimo.recordings.pose_track import PoseTrack
from evimo.recordings.truth import Truth


def poses(times_us):
    """A camera that turns and climbs, and two objects."""
    time_s = np.asarray(times_us) * 1e-6
    world_from_cam = moved(time_s, (0.3, -2.0, 0.4), (0.1, 0.2, 0.3))
    objects = [moved(time_s, (1.0, 0.5, 3.0), (0.0, 0.1, 1.0)), moved(time_s, (-2.0, 1.0, 0.2), (0.2, 0.1, 2.0))]
    return PoseTrack(times_us, world_from_cam, np.array([1, 2], np.uint8), np.stack(objects, axis=1))


def moved(time_s, spin, velocity):
    matrices = np.tile(np.eye(4), (len(time_s), 1, 1))
    matrices[:, :3, :3] = Rotation.from_rotvec(np.outer(time_s + 0.4, spin)).as_matrix()
    matrices[:, :3, 3] = np.outer(time_s + 1, velocity)
    return matrices


def save(path, camera, pieces):
    with Evimo1Writer(path, camera, poses=poses, facts={"seed": 3}) as writer:
        for events, truth in pieces:
            writer.write(events, truth)
    return path


@pytest.fixture
def film(tmp_path, camera, pieces):
    return save(tmp_path / "film.npz", camera, pieces)


@pytest.fixture
def stored(film):
    with np.load(film, allow_pickle=False) as archive:
        return dict(archive)


def test_our_reader_finds_every_event(film, camera, pieces):
    expected, opened = joined([events for events, _ in pieces]), open_events(film)
    read = joined(list(opened))
    assert opened.sensor == camera.size
    for name in ("x", "y", "t", "p"):
        np.testing.assert_array_equal(getattr(read, name), getattr(expected, name))


def test_keys_types_and_units_are_the_layouts(stored, camera, pieces):
    events = stored["events"]
    assert events.shape == (80, 4)
    assert events.dtype == np.float64
    assert set(events[:, 3]) == {0.0, 1.0}
    assert (stored["depth"].dtype, stored["mask"].dtype, stored["index"].dtype) == ("u2", "u2", "u4")
    assert stored["discretization"].shape == ()
    assert stored["discretization"] == 0.01
    np.testing.assert_array_equal(stored["K"], [[9.0, 0, 5.6], [0, 9.5, 3.4], [0, 0, 1]])
    np.testing.assert_array_equal(stored["D"], camera.distortion)  # not a tenth of it, as in the dataset
    for k, (_, truth) in enumerate(pieces):
        np.testing.assert_array_equal(stored["depth"][k] > 0, truth.valid)
        np.testing.assert_allclose(stored["depth"][k] / 1000, truth.depth, atol=0.00051)
        np.testing.assert_array_equal(stored["mask"][k], truth.ids * 1000.0)
        np.testing.assert_array_equal(stored["sim_clutter"][k], truth.clutter)


def test_meta_is_text_that_json_and_python_read_alike(stored):
    text = stored["meta"].item()
    meta = json.loads(text)
    assert meta == ast.literal_eval(text)
    assert meta["meta"] == {
        **{"fx": 9.0, "fy": 9.5, "cx": 5.6, "cy": 3.4},
        **{"k1": -0.2, "k2": 0.05, "k3": 0.001, "k4": -0.002},
        **{"res_x": 8, "res_y": 12},  # the height first
    }
    assert [frame["id"] for frame in meta["frames"]] == [0, 1, 2]
    assert [frame["ts"] for frame in meta["frames"]] == [0.0125, 0.0375, 0.0625]
    assert [frame["gt_frame"] for frame in meta["frames"]] == [f"depth_mask_{k}.png" for k in range(3)]
    assert [sample["ts"] for sample in meta["full_trajectory"]] == [round(0.005 * k, 6) for k in range(16)]


def matrix(pose):
    """A pose of `meta` as a matrix."""
    rigid = np.eye(4)
    rigid[:3, :3] = Rotation.from_quat([pose["q"][axis] for axis in "xyzw"]).as_matrix()
    rigid[:3, 3] = [pose["t"][axis] for axis in "xyz"]
    return rigid


def test_long_meta_is_written_in_parts_that_fit_together(tmp_path, camera, pieces):
    """Nothing is lost or repeated where one part ends."""
    moments = [(events, replace(truth, t_us=12_500 + 25_000 * k)) for k, (events, truth) in enumerate(pieces[:1] * 210)]
    with np.load(save(tmp_path / "long.npz", camera, moments)) as archive:
        meta = json.loads(archive["meta"].item())
    assert [frame["id"] for frame in meta["frames"]] == list(range(210))
    times = [sample["ts"] for sample in meta["full_trajectory"]]
    np.testing.assert_allclose(times, np.arange(210 * 5 + 1) * 0.005, atol=1e-9)


def test_convention_v1_camera_axes_are_up_left_backward(stored):
    """By swapping the rows and columns that up and left stand for, and turning every sign."""
    meta, up_left_backward = json.loads(stored["meta"].item()), [1, 0, 2]
    start = poses(np.array([0])).world_from_cam[0]
    for frame in meta["frames"]:
        exact = poses(np.array([round(frame["ts"] * 1e6)]))
        for name, cam_from_object in zip("12", exact.cam_from_object[0], strict=True):
            pose = matrix(frame[name]["pos"])
            np.testing.assert_allclose(pose[:3], -cam_from_object[:3][up_left_backward], atol=2e-9)
        start_from_cam = np.linalg.solve(start, exact.world_from_cam[0])
        camera = matrix(frame["cam"]["pos"])
        turn = start_from_cam[:3, :3][np.ix_(up_left_backward, up_left_backward)]
        np.testing.assert_allclose(camera[:3, :3], turn, atol=2e-9)
        np.testing.assert_allclose(camera[:3, 3], -start_from_cam[:3, 3][up_left_backward], atol=2e-9)
    np.testing.assert_allclose(matrix(meta["full_trajectory"][0]["cam"]["pos"]), np.eye(4), atol=1e-9)


def test_convention_rpy_turns_about_fixed_x_then_y_then_z(stored):
    for sample in json.loads(stored["meta"].item())["full_trajectory"]:
        for name in ("cam", "1", "2"):
            pose = sample[name]["pos"]
            about_x, about_y, about_z = (
                Rotation.from_rotvec(pose["rpy"][letter] * np.eye(3)[axis]).as_matrix()
                for axis, letter in enumerate("rpy")
            )
            np.testing.assert_allclose(about_z @ about_y @ about_x, matrix(pose)[:3, :3], atol=1e-8)


def test_exact_truth_lies_under_its_own_keys(stored, pieces):
    np.testing.assert_array_equal(stored["sim_ego"], [truth.ego for _, truth in pieces])
    assert stored["sim_object_ids"].tolist() == [1, 2]
    np.testing.assert_array_equal(stored["sim_velocities"][2, 1], pieces[2][1].objects[2].velocity)
    assert np.isnan(stored["sim_velocities"][0, 1]).all()
    times = np.array([truth.t_us for _, truth in pieces])
    np.testing.assert_array_equal(stored["sim_world_from_cam"], poses(times).world_from_cam)
    np.testing.assert_array_equal(stored["sim_cam_from_object"], poses(times).cam_from_object)
    assert json.loads(stored["sim_facts"].item())["seed"] == 3


def test_index_finds_the_first_event_of_every_ten_milliseconds():
    rng = np.random.default_rng(0)
    t = np.sort(rng.choice(200_000, 40)) + 5_000_000
    index = TimeIndex()
    for part in (t[:0], t[:7], t[7:8], t[8:8], t[8:]):
        index.add(part)
    grid = range(t[0], t[-1] + 1, STEP_US)
    assert index.table().tolist() == [*(min(np.flatnonzero(t >= at)) for at in grid), 39]
    assert TimeIndex().table().tolist() == []


def test_microseconds_survive_for_hours(tmp_path, camera, pieces):
    events, truth = pieces[0]
    events.t[:] += 36_000_000_000
    path = save(tmp_path / "late.npz", camera, [(events, truth)])
    np.testing.assert_array_equal(joined(list(open_events(path))).t, events.t)


def test_the_same_recording_gives_the_same_bytes(film, tmp_path, camera, pieces):
    assert save(tmp_path / "again.npz", camera, pieces).read_bytes() == film.read_bytes()


def test_memory_does_not_grow_with_length(tmp_path):
    size = (200, 300)
    camera = Camera(200.0, 200.0, 150.0, 100.0, *size)
    ids, seen = np.zeros(size, np.uint8), np.ones(size, bool)
    depth = np.ones(size, np.float32)

    def peak(slices):
        tracemalloc.start()
        with Evimo1Writer(tmp_path / f"{slices}.npz", camera, poses=poses) as writer:
            for k in range(slices):
                t = np.full(20_000, 25_000 * k)
                events = Events(t.astype(np.uint16), t.astype(np.uint16), t, np.ones(len(t), np.int8))
                writer.write(events, Truth(12_500 + 25_000 * k, depth, seen, ids, ~seen, np.zeros(6), {}))
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most

    short, long = peak(4), peak(24)
    assert long - short < 1.5e6  # of the 17 MB that 20 more slices hold


def test_what_breaks_off_leaves_nothing(tmp_path, camera, pieces):
    def broken(times_us):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), Evimo1Writer(tmp_path / "a.npz", camera, poses=poses) as writer:
        writer.write(*pieces[0])
        raise KeyboardInterrupt
    with pytest.raises(KeyboardInterrupt), Evimo1Writer(tmp_path / "a.npz", camera, poses=broken) as writer:
        writer.write(*pieces[0])
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten_and_other_lenses_are_refused(film, camera):
    with pytest.raises(BadInput, match="exists"):
        Evimo1Writer(film, camera, poses=poses)
    for lens in (
        Camera(9.0, 9.0, 5.0, 4.0, 8, 12, (0.1, 0.0, 0.0, 0.0), "fisheye"),
        Camera(9.0, 9.0, 5.0, 4.0, 8, 12, (0.1, 0.0, 0.0, 0.0, 0.2)),
    ):
        with pytest.raises(BadInput, match="cannot hold"):
            Evimo1Writer(film.with_name("b.npz"), lens, poses=poses)


def test_a_pinhole_without_events_is_written(tmp_path, pieces):
    camera = Camera(9.0, 9.0, 5.0, 4.0, 8, 12)
    path = save(tmp_path / "still.npz", camera, [(no_events(), pieces[0][1])])
    with np.load(path) as archive:
        assert archive["events"].shape == (0, 4)
        assert archive["index"].shape == (0,)
        assert archive["D"].tolist() == [0, 0, 0, 0]


def test_our_reader_takes_the_whole_lens_and_says_nothing(film, camera, recwarn):
    assert open_events(film).camera.camera == camera
    assert not recwarn.list
