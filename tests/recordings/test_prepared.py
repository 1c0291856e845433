import errno
from dataclasses import replace

import cv2
import numpy as np
import pytest

from evimo.errors import BadFile, BadInput, NotFound
from evimo.geometry.camera import Camera
from evimo.recordings import prepared as module
from evimo.recordings.finding import recordings_in
from evimo.recordings.prepared import open_prepared, prepare
from evimo.recordings.recording import open_recording
from evimo.recordings.truth import ObjectTruth
from evimo.recordings.writer import RecordingWriter
from evimo.simulate.plan import RecordingPlan
from evimo.simulate.recording import simulate_recording

SIZE = (48, 64)
PINHOLE = Camera(fx=50.0, fy=49.0, cx=31.0, cy=24.5, height=48, width=64)
BARREL = replace(PINHOLE, distortion=(-0.35, 0.12, 3e-4, -2e-4))


@pytest.fixture(scope="session")
def simulated(tmp_path_factory):
    """Simulates 0.1 s through a camera, once each; returns the folder."""
    made = {}

    def folder(camera):
        if camera not in made:
            path = tmp_path_factory.mktemp("recordings") / "recording"
            film = replace(
                simulate_recording(RecordingPlan(seed=3, set_number=1, seconds=0.1, size=SIZE)), camera=camera
            )
            with RecordingWriter(path, camera) as writer:
                for piece in film:
                    writer.write(piece.events, piece.truth, clutter_bodies=piece.clutter.astype(np.uint8))
            made[camera] = path
        return made[camera]

    return folder


@pytest.fixture
def opened(simulated):
    """The recording and its prepared arrays, of a camera."""

    def both(camera):
        return open_recording(simulated(camera)), open_prepared(prepare(simulated(camera)))

    return both


def events_by_slice(recording):
    packets = list(recording.events.packets())
    x, y, t, p = (np.concatenate([getattr(packet, name) for packet in packets]) for name in "xytp")
    return [(x[cut], y[cut], t[cut] - k * 25_000, p[cut] > 0) for k in range(4) for cut in [t // 25_000 == k]]


def test_without_a_lens_events_stay_where_they_are(opened):
    recording, prepared = opened(PINHOLE)
    assert len(prepared) == len(recording) == 4
    for k, (x, y, t_us, on) in enumerate(events_by_slice(recording)):
        cut = slice(*prepared.event_first[k : k + 2])
        np.testing.assert_array_equal(prepared.event_xy[cut], 64 * np.stack((x, y), axis=1))
        np.testing.assert_array_equal(prepared.event_t[cut], t_us)
        np.testing.assert_array_equal(prepared.event_on[cut], on)
    assert len(prepared.event_t) == prepared.event_first[-1] > 100


def test_without_a_lens_truth_is_that_of_the_recording(opened):
    recording, prepared = opened(PINHOLE)
    assert prepared.valid.all()
    for k in range(4):
        truth = recording.truth(k)
        np.testing.assert_array_equal(prepared.ids[k], truth.ids)
        np.testing.assert_allclose(prepared.depth[k], truth.depth, rtol=1e-3)
        np.testing.assert_allclose(prepared.ego[k], truth.ego, rtol=1e-6)
        np.testing.assert_array_equal(prepared.clutter[k], truth.clutter)


def test_flow_of_the_static_world_is_where_its_points_go(opened):
    recording, prepared = opened(PINHOLE)
    truth = recording.truth(1)
    y, x = np.mgrid[:48, :64]
    z = truth.depth.astype(float)
    points = np.stack(((x - PINHOLE.cx) / PINHOLE.fx * z, (y - PINHOLE.cy) / PINHOLE.fy * z, z)).reshape(3, -1)

    def seen_after(dt_s):
        turned = cv2.Rodrigues(truth.ego[3:] * dt_s)[0].T @ (points - truth.ego[:3, None] * dt_s)
        return (turned[:2] / turned[2]).reshape(2, *SIZE)

    static = (truth.ids == 0) & truth.valid
    expected = (seen_after(1e-5) - seen_after(-1e-5)) / 2e-5
    np.testing.assert_allclose(prepared.flow[1][:, static], expected[:, static], rtol=2e-3, atol=1e-3)


def test_what_moves_is_what_has_a_speed(opened):
    recording, prepared = opened(PINHOLE)
    for k in range(4):
        moved = recording.truth(k).objects
        fast = [
            n for n, m in moved.items() if max(np.linalg.norm(m.velocity) / 0.03, np.linalg.norm(m.rotation) / 0.17) > 1
        ]
        np.testing.assert_array_equal(prepared.moving[k], np.isin(prepared.ids[k], fast))
        for number in fast:
            np.testing.assert_allclose(prepared.velocity[k, number], moved[number].velocity, rtol=1e-6)
        assert not prepared.velocity[k, 0].any()


@pytest.mark.parametrize(
    ("cm_per_s", "degrees_per_s", "moves"), [(2.9, 0, False), (3.1, 0, True), (0, 9.5, False), (0, 10.5, True)]
)
def test_what_is_slower_than_3_cm_or_10_degrees_per_second_rests(cm_per_s, degrees_per_s, moves, simulated, tmp_path):
    """Its velocity then counts as nothing, too."""
    recording = open_recording(simulated(PINHOLE))
    velocity = np.array((0.6, 0, -0.8)) * cm_per_s / 100
    moved = ObjectTruth(np.array((0, 0, 1.0)), velocity, np.deg2rad((0, degrees_per_s, 0)))
    ids = np.zeros(SIZE, np.uint8)
    ids[10:20, 10:30] = 5
    with RecordingWriter(tmp_path / "recording", PINHOLE) as writer:
        for packet in recording.events.packets():
            writer.write(packet, replace(recording.truth(0), ids=ids, objects={5: moved}))
            break
    prepared = open_prepared(prepare(tmp_path / "recording"))
    np.testing.assert_array_equal(prepared.moving[0], (ids == 5) & moves)
    np.testing.assert_allclose(prepared.velocity[0, 5], velocity * moves, atol=1e-6)


def rectified_by_opencv(intrinsics, xy):
    """Where OpenCV's own undistortion puts sensor pixels (N, 2)."""
    sensor = np.array(((50, 0, 31), (0, 49, 24.5), (0, 0, 1)))
    fx, fy, cx, cy = intrinsics
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-9)
    at = cv2.undistortPoints(
        xy.astype(np.float64)[:, None],
        sensor,
        np.array(BARREL.distortion),
        P=np.array(((fx, 0, cx), (0, fy, cy), (0, 0, 1))),
        criteria=criteria,
    )
    return at[:, 0]


def test_events_go_where_opencv_puts_them(opened):
    recording, prepared = opened(BARREL)
    for k, (x, y, t_us, on) in enumerate(events_by_slice(recording)):
        at = rectified_by_opencv(prepared.intrinsics.astype(float), np.stack((x, y), axis=1))
        inside = ((at > -0.5) & (at < (63.5, 47.5))).all(axis=1)
        cut = slice(*prepared.event_first[k : k + 2])
        assert abs(inside.sum() - len(prepared.event_t[cut])) <= 0.01 * len(x)
        np.testing.assert_allclose(prepared.event_xy[cut] / 64, at[inside].clip(0, (63, 47)), atol=0.02)
        np.testing.assert_array_equal(prepared.event_t[cut], t_us[inside])
        np.testing.assert_array_equal(prepared.event_on[cut], on[inside])


def test_truth_of_a_lens_is_looked_up_where_opencv_projects(opened):
    recording, prepared = opened(BARREL)
    fx, fy, cx, cy = prepared.intrinsics.astype(float)
    y, x = np.mgrid[:48, :64]
    rays = np.stack(((x - cx) / fx, (y - cy) / fy, np.ones(SIZE)), axis=-1).reshape(-1, 3)
    sensor = np.array(((50, 0, 31), (0, 49, 24.5), (0, 0, 1)))
    at = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), sensor, np.array(BARREL.distortion))[0].reshape(*SIZE, 2)
    column, row = np.round(at).astype(int).transpose(2, 0, 1)
    inside = (column >= 0) & (column < 64) & (row >= 0) & (row < 48)
    np.testing.assert_array_equal(prepared.valid, inside)
    assert inside.mean() > 0.5
    expected = np.where(inside, recording.truth(2).depth[row.clip(0, 47), column.clip(0, 63)], 0)
    np.testing.assert_allclose(prepared.depth[2], expected, rtol=1e-3)
    assert not prepared.moving[:, ~inside].any()


def test_preparing_is_done_once(simulated):
    folder = prepare(simulated(PINHOLE))
    before = (folder / "depth.npy").stat().st_mtime_ns
    assert prepare(simulated(PINHOLE)) == folder
    assert (folder / "depth.npy").stat().st_mtime_ns == before


def test_a_folder_that_holds_more_is_read(simulated, tmp_path):
    """As versions before wrote it, with an array `frames`."""
    for file in prepare(simulated(PINHOLE)).iterdir():
        (tmp_path / file.name).symlink_to(file)
    np.save(tmp_path / "frames.npy", np.zeros((4, 3, *SIZE), np.float16))
    assert len(open_prepared(tmp_path)) == 4


def test_a_failure_leaves_nothing_behind(simulated, tmp_path, monkeypatch):
    folder = tmp_path / "copy"
    folder.mkdir()
    for file in simulated(PINHOLE).glob("dataset_*"):
        (folder / file.name).symlink_to(file)
    before = sorted(folder.iterdir())

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(module, "_save_array", full)
        with pytest.raises(BadInput, match=f"cannot write {folder}"):
            prepare(folder)
    assert sorted(folder.iterdir()) == before
    assert len(open_prepared(prepare(folder))) == 4


@pytest.mark.parametrize("left", [b"", b"{", b"3", b"\x93NUMPY"])
@pytest.mark.parametrize("name", ["camera.json", "depth.npy", "event_t.npy"])
def test_damaged_arrays_are_said_to_be(name, left, simulated, tmp_path):
    source = prepare(simulated(PINHOLE))
    for file in source.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes() if file.name != name else left)
    with pytest.raises(BadFile, match="delete it"):
        open_prepared(tmp_path)


def test_recordings_are_found_at_any_depth_and_by_name(tmp_path):
    for name in ("b", "a", "deep/er/c"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "dataset_sim.npz").touch()
    found = recordings_in([tmp_path])
    assert [str(path.relative_to(tmp_path)) for path in found] == ["a", "b", "deep/er/c"]
    assert recordings_in([tmp_path / "b", tmp_path / "a"]) == [tmp_path / "b", tmp_path / "a"]


def test_a_recording_that_is_being_written_is_not_found(tmp_path):
    """Every folder and file of the writer's, at the moment before the recording gets its name."""
    with RecordingWriter(tmp_path / "new", PINHOLE):
        for folder in [path for path in tmp_path.rglob("*") if path.is_dir()]:
            (folder / "dataset_sim.npz").touch()
        with pytest.raises(NotFound):
            recordings_in([tmp_path])
    assert recordings_in([tmp_path]) == [tmp_path / "new"]


def test_a_folder_without_recordings(tmp_path):
    with pytest.raises(NotFound, match="evimo simulate"):
        recordings_in([tmp_path])
