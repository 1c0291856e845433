"""What misleads readers of EV-IMO and EVIMO2, each in files of the very layouts that it is found in.

The others have their tests beside what they concern, in test_datasets.py and test_checking.py.
"""

import os
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.recordings.dataset_files import (
    STOP_US,
    TIMES_US,
    V2_IDS,
    all_events,
    event_rows,
    renamed,
    v1_meta,
    v1_npz,
    v1_numbers,
    v1_text,
    v2_folder,
    v2_meta,
    v2_npz,
)
from tests.recordings.known_scene import CAMERA, HALF_M, events, poses, truth

from evimo.errors import BadFile, EvimoWarning
from evimo.events.events import joined
from evimo.formats import open_events
from evimo.recordings.checking import findings
from evimo.recordings.dataset_cameras import AS_WRITTEN, RENDERED, as_drawn
from evimo.recordings.evimo1_writer import Evimo1Writer
from evimo.recordings.pose_track import PoseTrack
from evimo.recordings.pose_words import frame_words, trajectory_words
from evimo.recordings.recording import open_recording

EVERY = {
    "EV-IMO npz": lambda at, meta: v1_npz(at / "a.npz", meta=meta or v1_meta()),
    "EV-IMO text": lambda at, meta: v1_text(at / "a", meta=meta or v1_meta()),
    "EVIMO2 npz": lambda at, meta: v2_npz(at / "a.npz", meta=meta or v2_meta()),
    "EVIMO2 folder": lambda at, meta: v2_folder(at / "a", meta=meta or v2_meta()),
}
every_layout = pytest.mark.parametrize("layout", EVERY)


def meta_of(layout):
    return v1_meta() if layout.startswith("EV-IMO") else v2_meta()


def found(path, about):
    """What `evimo check` says of one thing, and whether it calls it a defect."""
    (each,) = [each for each in findings(path, open_events(path)) if each.about == about]
    return each.words, each.defect


# ---- trap 7: polarity -----------------------------------------------------------------------------------------------


def test_samsung_polarity_is_turned_in_the_first_layout_too(tmp_path):
    rows = event_rows()
    rows[:, 3] = 1 - rows[:, 3]
    path = v2_npz(tmp_path / "samsung_mono" / "imo" / "eval" / "a.npz", events=rows)
    np.testing.assert_array_equal(joined(list(open_recording(path).events)).p, all_events().p)


@pytest.mark.parametrize("made", [lambda t: (t > 0.4).astype(np.uint8), lambda t: t.astype(np.uint8)])
def test_polarity_that_was_made_from_times_is_found(tmp_path, made):
    """EVIMO2 as it was downloaded before 24 May 2022."""
    folder = v2_folder(tmp_path / "left_camera" / "imo" / "eval" / "a")
    assert not found(folder, "polarity")[1]
    np.save(folder / "dataset_events_p.npy", made(np.load(folder / "dataset_events_t.npy")))
    words, defect = found(folder, "polarity")
    assert defect and "before 24 May 2022" in words


def test_a_late_part_whose_polarity_was_made_from_times_is_refused(tmp_path):
    """Whole seconds, none of which is 0."""
    folder = v2_folder(tmp_path / "left_camera" / "imo" / "eval" / "a")
    t = np.load(folder / "dataset_events_t.npy")
    np.save(folder / "dataset_events_p.npy", (t + 99.9).astype(np.uint8))
    with pytest.raises(
        BadFile, match=r"polarities are 99 and 100.*\n.*EVIMO2 of before 24 May 2022: download it again"
    ):
        open_recording(folder).events.packets()


# ---- trap 11: an object's `ts` is that of the camera's pose ----------------------------------------------------------


@every_layout
@pytest.mark.parametrize("stamp", [None, 1e5])
def test_times_of_objects_and_of_the_camera_are_those_of_their_entry(tmp_path, layout, stamp):
    """`ts` inside an entry says when another body was sampled: nothing is read from it, whatever it holds."""
    meta = meta_of(layout)
    for entry in (*meta["frames"], *meta["full_trajectory"]):
        for body in (value for value in entry.values() if isinstance(value, dict)):
            del body["ts"]
            if stamp:
                body["ts"] = stamp - entry["ts"]
    one = open_recording(EVERY[layout](tmp_path / "told", meta_of(layout)))
    two = open_recording(EVERY[layout](tmp_path / "not", meta))
    np.testing.assert_array_equal(two.times_us, TIMES_US)
    for k in range(len(one)):
        np.testing.assert_array_equal(one.truth(k).ego, two.truth(k).ego)
        for key, body in one.truth(k).objects.items():
            np.testing.assert_array_equal(body.position, two.truth(k).objects[key].position)
            np.testing.assert_array_equal(body.velocity, two.truth(k).objects[key].velocity)


# ---- trap 16: every camera has a world of its own --------------------------------------------------------------------

LEFT_FROM_RIGHT = np.eye(4)
LEFT_FROM_RIGHT[:3, :3] = Rotation.from_euler("xyz", (0.03, -0.05, 3.1)).as_matrix()  # as askew as EVIMO2's
LEFT_FROM_RIGHT[:3, 3] = 0.04, -0.2, 0.015


def seen_by_the_right(times_us):
    """The same scene in the words of another camera of the rig, whose world is where that camera was first."""
    track = poses(times_us)
    right_from_left = np.linalg.inv(LEFT_FROM_RIGHT)
    world_from_left = np.linalg.inv(poses([0]).world_from_cam[0]) @ track.world_from_cam
    world_from_cam = right_from_left @ world_from_left @ LEFT_FROM_RIGHT
    return PoseTrack(track.times_us, world_from_cam, track.object_ids, right_from_left @ track.cam_from_object)


@pytest.mark.parametrize("layout", ["EVIMO2 npz", "EVIMO2 folder"])
def test_motions_do_not_depend_on_the_world_that_a_camera_chose(tmp_path, layout):
    """Two cameras of one rig: what they say of one motion differs by how they are mounted, and by nothing else."""
    meta = v2_meta()
    meta["frames"] = renamed(frame_words(seen_by_the_right(TIMES_US)), V2_IDS)
    meta["full_trajectory"] = renamed(trajectory_words(seen_by_the_right(np.arange(0, STOP_US, 5000))), V2_IDS)
    left = open_recording(EVERY[layout](tmp_path / "left_camera" / "imo", v2_meta()))
    right = open_recording(EVERY[layout](tmp_path / "right_camera" / "imo", meta))
    turn, arm = LEFT_FROM_RIGHT[:3, :3], LEFT_FROM_RIGHT[:3, 3]
    for recording in (left, right):  # each was at its own origin first
        np.testing.assert_allclose(recording.paths.poses(np.zeros(1, np.int64)).world_from_cam[0], np.eye(4), atol=1e-4)
    for k in (0, 8, 17):
        one, two = left.truth(k), right.truth(k)
        assert one.movers == two.movers == list(V2_IDS[:2])
        np.testing.assert_allclose(turn @ two.ego[3:], one.ego[3:], atol=2e-3)
        np.testing.assert_allclose(turn @ two.ego[:3], one.ego[:3] + np.cross(one.ego[3:], arm), atol=2e-3)
        for key, body in one.objects.items():
            np.testing.assert_allclose(turn @ two.objects[key].velocity, body.velocity, atol=2e-3)
            np.testing.assert_allclose(turn @ two.objects[key].position + arm, body.position, atol=1e-6)


# ---- trap 17: a camera without frames holds a pickled None -----------------------------------------------------------


class Evil:
    def __init__(self, command):
        self.command = command

    def __reduce__(self):
        return os.system, (self.command,)


@pytest.mark.parametrize("layout", ["EVIMO2 npz", "EVIMO2 folder"])
def test_what_a_camera_without_frames_holds_is_never_unpickled(tmp_path, layout):
    trace = tmp_path / "ran"
    trap = np.array(Evil(f"touch {trace}"), object)
    if layout == "EVIMO2 npz":
        path = v2_npz(tmp_path / "a.npz", classical=trap)
    else:
        path = v2_folder(tmp_path / "a")
        np.savez_compressed(path / "dataset_classical.npz", empty=trap)
    recording = open_recording(path)
    assert len(recording) == len(TIMES_US) and recording.truth(3).valid.any()
    assert "frames" not in recording.events.contents
    assert not trace.exists()


# ---- trap 18: `index` is off by when the first event was -------------------------------------------------------------


@every_layout
def test_a_slice_is_found_by_the_times_of_its_events(tmp_path, layout):
    """To the microsecond, and with its last event; what the files say in `index` is wrong on purpose."""
    recording = open_recording(EVERY[layout](tmp_path, None))
    whole = all_events()
    for start_us, stop_us in ((0, 25_000), (226_000, 249_500), (int(whole.t[-1]), STOP_US)):
        read, expected = joined(list(recording.events.packets(start_us, stop_us))), whole.between(start_us, stop_us)
        for name in ("x", "y", "t", "p"):
            np.testing.assert_array_equal(getattr(read, name), getattr(expected, name))


# ---- frames and samples that lack their pose -------------------------------------------------------------------------


@every_layout
@pytest.mark.parametrize(
    ("part", "number", "said"),
    [
        ("frames", 3, "has maps, and lacks 'cam', the camera's pose"),
        ("full_trajectory", 70, "lacks 'cam'"),
    ],
)
def test_what_lacks_the_pose_of_its_camera_is_an_error(tmp_path, layout, part, number, said):
    meta = meta_of(layout)
    del meta[part][number]["cam"]
    path = EVERY[layout](tmp_path, meta)
    with pytest.raises(BadFile, match=rf"a.*\['{part}'\]\[{number}\] {said}\n  try: copy"):
        open_recording(path)


@every_layout
def test_frames_whose_pose_is_no_number_are_left_out_and_counted(tmp_path, layout):
    meta = meta_of(layout)
    meta["frames"][3]["cam"]["pos"]["t"]["y"] = float("nan")
    object_ = "1" if layout.startswith("EV-IMO") else str(V2_IDS[0])
    for values in (meta["frames"][5][object_]["pos"]["q"], meta["frames"][5][object_]["pos"]["rpy"]):
        values.update(dict.fromkeys(values, float("nan")))
    with pytest.warns(EvimoWarning, match="2 of 18 frames are left out: 2 with a pose or a motion that is not known"):
        recording = open_recording(EVERY[layout](tmp_path, meta))
    np.testing.assert_array_equal(recording.times_us, np.delete(TIMES_US, (3, 5)))


def test_frames_that_evimo2_flags_are_left_out_and_counted(tmp_path):
    """Its second layout keeps frames without truth, with neither a pose nor maps."""
    with pytest.warns(EvimoWarning, match="3 of 18 frames are left out: 3 with no maps"):
        recording = open_recording(v2_folder(tmp_path / "a", unknown=(0, 5, 6)))
    np.testing.assert_array_equal(recording.times_us, np.delete(TIMES_US, (0, 5, 6)))


# ---- the renderer's half pixel ---------------------------------------------------------------------------------------

PINHOLE = replace(CAMERA, distortion=())


def drawn(t_us, convention):
    """Ids by the datasets' own projector: points of the boards, cut off to pixels; in the first version from its axes.

    That takes x up, y left and z backward, applies `fx` and `cx` to rows, and counts from the far end.
    """
    track, numbers = poses([t_us]), v1_numbers(replace(CAMERA, distortion=(0.0,) * 4))
    nearest, ids = np.full(CAMERA.size, np.inf), np.zeros(CAMERA.size, np.uint8)
    across, down = np.meshgrid(*(np.linspace(-half, half, 700) for half in HALF_M))
    board = np.stack((across.ravel(), down.ravel(), np.zeros(across.size), np.ones(across.size)))
    for column in range(3):
        x, y, z, _ = track.cam_from_object[0, column] @ board
        if convention == RENDERED:
            up, left = -y / z, -x / z
            row = CAMERA.height - 1 - np.trunc(numbers["fx"] * up + numbers["cx"]).astype(int)
            col = CAMERA.width - 1 - np.trunc(numbers["fy"] * left + numbers["cy"]).astype(int)
        else:
            col = np.trunc(CAMERA.fx * x / z + CAMERA.cx).astype(int)
            row = np.trunc(CAMERA.fy * y / z + CAMERA.cy).astype(int)
        order = np.argsort(-z)
        assert col.min() > 0 and row.min() > 0 and col.max() < CAMERA.width and row.max() < CAMERA.height
        fresh = np.full(CAMERA.size, np.inf)
        fresh[row[order], col[order]] = z[order]
        ids[fresh < nearest] = column + 1
        nearest = np.minimum(nearest, fresh)
    return ids


@pytest.mark.parametrize("convention", [AS_WRITTEN, RENDERED])
def test_maps_show_what_is_half_a_pixel_beside(convention):
    """Where the middle of everything seen lies: with the datasets' projector, and by rays through pixel centres."""
    made = drawn(200_000, convention)
    middle = lambda ids: np.argwhere(ids > 0).mean(axis=0)  # noqa: E731
    half, plain = (truth(200_000, camera=each).ids for each in (as_drawn(PINHOLE, convention), PINHOLE))
    np.testing.assert_allclose(middle(made), middle(half), atol=0.1)
    np.testing.assert_allclose(np.abs(middle(made) - middle(plain)), 0.5, atol=0.2)


@pytest.mark.parametrize(("layout", "side"), [("EV-IMO npz", "left of and above"), ("EVIMO2 folder", "right of and")])
def test_the_half_pixel_is_said(tmp_path, layout, side):
    words, defect = found(EVERY[layout](tmp_path, None), "half a pixel")
    assert side in words and not defect


def test_no_half_pixel_is_said_of_what_this_package_drew(tmp_path):
    """EV-IMO's first layout, as `evimo simulate` writes it: its maps are of pixel centres."""
    film = tmp_path / "film.npz"
    with Evimo1Writer(film, CAMERA, poses=poses) as writer:
        for t_us in range(0, 100_000, 25_000):
            writer.write(events(t_us, t_us + 25_000), truth(t_us + 12_500))
    found_there = {each.about for each in findings(film, open_events(film))}
    assert "frames" in found_there and not found_there & {"half a pixel", "principal point"}
