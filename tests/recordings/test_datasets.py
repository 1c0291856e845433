"""EV-IMO and EVIMO2 in their own layouts, read back as the scene that they were made from."""

import json
import os

import numpy as np
import pytest
from tests.recordings.dataset_files import (
    STOP_US,
    TIMES_US,
    V2_IDS,
    all_events,
    maps,
    v1_bag,
    v1_meta,
    v1_npz,
    v1_text,
    v2_folder,
    v2_meta,
    v2_npz,
)
from tests.recordings.known_scene import poses, truth

from evimo.errors import BadFile, EvimoWarning, NotFound
from evimo.events.events import joined
from evimo.recordings.carried_truth import carried
from evimo.recordings.dataset_cameras import RENDERED
from evimo.recordings.datasets import open_dataset
from evimo.recordings.finding import recordings_in
from evimo.recordings.layouts import layout_of
from evimo.recordings.recording import open_recording

LAYOUTS = {
    "EV-IMO npz": lambda at: v1_npz(at / "train" / "box" / "npz" / "seq_01.npz"),
    "EV-IMO npz, uint16": lambda at: v1_npz(at / "seq_01.npz", floats=False),
    "EV-IMO text": lambda at: v1_text(at / "seq_01"),
    "EVIMO2 npz": lambda at: v2_npz(at / "left_camera" / "imo" / "eval" / "scene13_dyn_test_00_000000.npz"),
    "EVIMO2 folder": lambda at: v2_folder(at / "left_camera" / "imo" / "eval" / "scene13_dyn_test_00_000000"),
}


@pytest.fixture(scope="module", params=LAYOUTS)
def opened(request, tmp_path_factory):
    recording = open_recording(LAYOUTS[request.param](tmp_path_factory.mktemp("files")))
    return recording, V2_IDS if "2" in request.param else (1, 2, 3)


def test_events_come_back(opened):
    recording, _ = opened
    read, written = joined(list(recording.events)), all_events()
    for name in ("x", "y", "p"):
        np.testing.assert_array_equal(getattr(read, name), getattr(written, name))
    # 32 bits hold the microsecond up to 16 s
    np.testing.assert_array_equal(read.t, written.t)
    assert read.t.dtype == np.int64
    assert recording.event_count() == len(written)
    assert recording.events.camera.camera == recording.camera


def test_camera_is_found_whatever_its_words(opened):
    recording, _ = opened
    found = [*(getattr(recording.camera, name) for name in ("fx", "fy", "cx", "cy")), *recording.camera.distortion]
    np.testing.assert_allclose(found, [70.0, 72.0, 43.0, 25.5, -0.1, 0.02, 0.004, -0.003], atol=1e-9)
    assert recording.camera.size == (60, 80)


def test_truth_is_the_scenes(opened):
    recording, ids = opened
    np.testing.assert_array_equal(recording.times_us, TIMES_US)
    for k in (0, 7, 17, 3):
        mine, scene = recording.truth(k), truth(TIMES_US[k], ids)
        np.testing.assert_array_equal(mine.ids, scene.ids)
        np.testing.assert_array_equal(mine.valid, scene.valid)
        np.testing.assert_allclose(mine.depth, scene.depth, atol=0.00051)
        np.testing.assert_allclose(mine.ego, scene.ego, atol=1e-3)
        assert mine.objects.keys() == set(ids)
        for id_ in ids:
            for name, error in (("position", 1e-7), ("velocity", 2e-3), ("rotation", 3e-3)):
                np.testing.assert_allclose(
                    getattr(mine.objects[id_], name), getattr(scene.objects[id_], name), atol=error
                )


def test_only_what_moves_is_called_moving(opened):
    recording, ids = opened
    assert set(recording.truth(9).movers) == set(ids[:2])
    assert set(np.unique(recording.truth(9).ids)) == {0, *ids}


def test_poses_are_known_at_any_time(opened):
    recording, ids = opened
    at = np.array([3_333, 222_222, 690_001])
    found, scene = recording.paths.poses(at), poses(at)
    assert found.object_ids.tolist() == list(ids)
    np.testing.assert_allclose(found.world_from_cam, scene.world_from_cam, atol=2e-5)
    np.testing.assert_allclose(found.cam_from_object, scene.cam_from_object, atol=2e-5)
    assert np.isnan(recording.paths.poses(np.array([STOP_US])).world_from_cam).all()


def test_truth_between_frames_is_carried_there(opened):
    """By ray casting at the other instant: ids agree but for a seam of pixels, depth to a hundredth."""
    recording, ids = opened
    before = recording.truth(2)
    mine, scene = carried(before, 349_500, recording.paths, recording.camera), truth(349_500, ids)
    wrong, frozen = ((each.ids != scene.ids).sum() for each in (mine, before))
    assert frozen > 0.1 * (scene.ids > 0).sum()
    assert wrong < 0.6 * frozen
    both = mine.valid & scene.valid & (mine.ids == scene.ids)
    assert np.abs(mine.depth / np.where(both, scene.depth, 1) - 1)[both].max() < 0.03
    still = before.valid & scene.valid & (before.ids == scene.ids)
    errors = [np.abs(each.depth - scene.depth)[still & both].mean() for each in (mine, before)]
    assert errors[0] < 0.4 * errors[1]
    near = recording.truth_at(262_300)
    assert near.t_us == 262_300
    np.testing.assert_allclose(near.objects[ids[0]].velocity, truth(262_300, ids).objects[ids[0]].velocity, atol=2e-3)
    assert recording.truth_at(TIMES_US[4] + 900).t_us == TIMES_US[4]
    assert recording.truth_at(100_000) is None


def test_folders_say_where_in_a_dataset_it_lies(tmp_path):
    one = open_recording(LAYOUTS["EV-IMO npz"](tmp_path)).meta
    assert (one["set"], one["background"], one["folder"], one["layout"]) == ("EV-IMO", "box", "train", "EV-IMO npz")
    two = open_recording(LAYOUTS["EVIMO2 folder"](tmp_path)).meta
    assert (two["set"], two["background"], two["folder"], two["sensor"]) == ("EVIMO2", "imo", "eval", "left_camera")


def test_frames_without_truth_and_frames_twice_are_passed_over(tmp_path):
    recording = open_recording(v2_folder(tmp_path / "a", unknown=(0, 5, 6)))
    np.testing.assert_array_equal(recording.times_us, np.delete(TIMES_US, (0, 5, 6)))
    np.testing.assert_array_equal(recording.truth(4).ids, truth(TIMES_US[7], V2_IDS).ids)
    meta = v1_meta(np.where(np.arange(18) == 4, TIMES_US[3], TIMES_US))
    assert len(open_recording(v1_npz(tmp_path / "twice.npz", meta=meta))) == 17


@pytest.mark.parametrize("how", ["empty", "missing"])
def test_a_camera_of_frames_is_no_recording_of_events(how, tmp_path):
    """EVIMO2's flea3_7 has truth and no events; training on the whole dataset passes over it."""
    folder = v2_folder(tmp_path / "flea3_7" / "imo" / "eval" / "a")
    other = v2_folder(tmp_path / "left_camera" / "imo" / "eval" / "a")
    for name, shape in (("t", (0,)), ("xy", (0, 2)), ("p", (0,))):
        file = folder / f"dataset_events_{name}.npy"
        file.unlink() if how == "missing" else np.save(file, np.zeros(shape, np.float32))
    with pytest.raises(BadFile, match=r"holds no events, as those of EVIMO2's frame camera flea3_7\n  try: the same"):
        open_recording(folder)
    assert recordings_in([tmp_path]) == [other]
    with pytest.raises(BadFile, match="flea3_7"):
        recordings_in([folder])


def test_a_part_that_begins_late_keeps_the_datasets_clock(tmp_path):
    """Times count from the start of the bag: of a later part they begin at 100 s, where 32 bits hold 8 us."""
    meta = v2_meta()
    for entry in (*meta["frames"], *meta["full_trajectory"]):
        entry["ts"] += 100.0
        entry["cam"]["ts"] += 100.0
    folder = v2_folder(tmp_path / "a", meta=meta, t_kind=np.float64)
    times_s = 100 + np.load(folder / "dataset_events_t.npy")
    np.save(folder / "dataset_events_t.npy", times_s.astype(np.float32))
    recording = open_recording(folder)
    np.testing.assert_array_equal(recording.times_us, TIMES_US + 100_000_000)
    assert np.abs(joined(list(recording.events)).t - 100_000_000 - all_events().t).max() <= 4
    np.testing.assert_array_equal(recording.truth(3).ids, truth(TIMES_US[3], V2_IDS).ids)


def test_a_fisheye_has_the_four_coefficients_of_meta(tmp_path):
    meta = v2_meta()
    meta["meta"] |= {"dist_model": "equidistant", "k1": 0.01, "k2": -0.02, "k3": 0.03, "k4": -0.04}
    camera = open_recording(v2_folder(tmp_path / "a", meta=meta)).camera
    assert (camera.lens, camera.distortion) == ("fisheye", (0.01, -0.02, 0.03, -0.04))


def test_samsung_polarity_is_turned(tmp_path):
    recording = open_recording(v2_folder(tmp_path / "samsung_mono" / "imo" / "eval" / "a", inverted=True))
    np.testing.assert_array_equal(joined(list(recording.events)).p, all_events().p)


def test_a_lost_object_voids_only_what_it_is_in(tmp_path):
    """Its last pose is repeated for 100 ms, as the dataset does; frames there are left out, and no speed is made up."""
    meta = v1_meta()
    first = meta["full_trajectory"][80]
    for entry in meta["full_trajectory"][81:101]:
        # what is repeated is the pose in the world, seen by a camera that moves on
        entry["1"] = repeated(first, entry)
    with pytest.warns(EvimoWarning, match=r"[34] of 18 frames are left out: [34] with a pose or a"):
        recording = open_recording(v1_npz(tmp_path / "lost.npz", meta=meta))
    gone = set(TIMES_US.tolist()) - set(recording.times_us.tolist())
    assert gone == {425_000, 450_000, 475_000, 500_000} or gone == {425_000, 450_000, 475_000}
    speeds = [np.linalg.norm(recording.truth(k).objects[1].velocity) for k in range(len(recording))]
    np.testing.assert_allclose(speeds, np.linalg.norm((0.25, 0.1, -0.1)), atol=0.02)


def repeated(first, entry):
    from evimo.formats.evimo_meta import _matrices
    from evimo.recordings.pose_words import _words

    cam = _matrices([first["cam"], entry["cam"]], "", "")
    body = _matrices([first["1"]], "", "")
    return {"pos": _words(np.linalg.inv(cam[1:]) @ cam[:1] @ body)[0], "ts": entry["ts"]}


def test_a_bag_gives_poses_in_the_events_clock(tmp_path):
    path = v1_bag(tmp_path / "seq_00")
    recording = open_recording(path)
    start = recording.events.start_us
    assert recording.meta["layout"] == "EV-IMO bag"
    first_us = int(all_events().t[0])
    for k in (0, 10):
        mine = recording.truth(k)
        # The dataset's clock has its first event when its message was received.
        scene = truth(int(recording.times_us[k]) - start + first_us)
        assert not mine.valid.any()
        np.testing.assert_allclose(mine.ego, scene.ego, atol=3e-3)
        assert mine.objects.keys() == {1, 2}
        np.testing.assert_allclose(mine.objects[2].velocity, scene.objects[2].velocity, atol=3e-3)
    assert recording.camera.cx == pytest.approx(43.0)
    with pytest.raises(NotFound, match=r"is a bag, which holds no maps of truth\n  try: `evimo annotate`"):
        recordings_in([path])


def test_an_occluded_object_is_not_known_in_a_bag(tmp_path):
    recording = open_recording(v1_bag(tmp_path / "seq_00", lost=(300_000, 420_000)))
    start = recording.events.start_us - int(all_events().t[0])
    known = {int(t) - start: 2 in recording.truth(k).objects for k, t in enumerate(recording.times_us)}
    assert not any(there for t, there in known.items() if 305_000 < t < 410_000)
    assert all(there for t, there in known.items() if not 290_000 < t < 425_000)


def test_the_principal_point_is_found_by_the_maps_themselves(tmp_path):
    """Whether `meta` gives it to columns and rows, as it says, or as the dataset's projector applies it."""
    written = {"fx": 70.0, "fy": 72.0, "cx": 43.0, "cy": 25.5, "k1": -0.1, "k2": 0.02, "k3": 0.004, "k4": -0.003}
    straight = v1_npz(tmp_path / "a.npz", meta=v1_meta(numbers=written | {"res_x": 60, "res_y": 80}))
    for path in (straight, v1_npz(tmp_path / "b.npz")):
        recording = open_recording(path)
        assert (recording.camera.cx, recording.camera.cy) == pytest.approx((43.0, 25.5))
    test = open_dataset(path, layout_of(path)).test()
    assert test.best("as written") == RENDERED
    assert test.points > 1000
    assert test.shares[RENDERED] > max(share for name, share in test.shares.items() if name != RENDERED) + 0.05


# ---- hostile files ---------------------------------------------------------------------------------------------------


class Evil:
    def __init__(self, command):
        self.command = command

    def __reduce__(self):
        return os.system, (self.command,)


@pytest.mark.parametrize("layout", ["EV-IMO npz", "EVIMO2 npz", "EVIMO2 folder"])
def test_a_pickle_that_would_run_code_does_not(tmp_path, layout):
    path, trace = LAYOUTS[layout](tmp_path), tmp_path / "ran"
    meta = np.array({"meta": Evil(f"touch {trace}"), "frames": []}, object)
    file = path / "dataset_info.npz" if path.is_dir() else path
    with np.load(file, allow_pickle=True) as stored:
        arrays = {**{name: stored[name] for name in stored if name not in ("meta", "classical")}, "meta": meta}
    np.savez(file, **arrays)
    with pytest.raises(BadFile, match=r"`meta` in .* may run code: refused\n  try: "):
        open_recording(path)
    assert not trace.exists()
    with np.load(file, allow_pickle=True) as stored:  # the trap is a real one
        _ = stored["meta"]
    assert trace.exists()


def spoilt(change):
    meta = v1_meta()
    change(meta)
    return meta


def taken_from(*keys):
    def change(meta):
        place = meta
        for key in keys[:-1]:
            place = place[key]
        del place[keys[-1]]

    return change


def put_at(*keys, value):
    def change(meta):
        place = meta
        for key in keys[:-1]:
            place = place[key]
        place[keys[-1]] = value

    return change


SPOILT = {
    "lacks 'frames'": taken_from("frames"),
    "lacks 'meta'": taken_from("meta"),
    r"\['frames'\]\[3\] lacks 'ts'": taken_from("frames", 3, "ts"),
    r"\['frames'\]\[2\]\['cam'\] lacks 'pos'": taken_from("frames", 2, "cam", "pos"),
    r"\['1'\]\['pos'\]\['t'\] lacks 'z'": taken_from("frames", 2, "1", "pos", "t", "z"),
    r"\['ts'\] is 'soon', no number": put_at("frames", 3, "ts", value="soon"),
    r"\['ts'\] is no time": put_at("frames", 3, "ts", value=float("nan")),
    r"\['frames'\]\[5\] goes back in time, from 0\.301000 s to 0\.100000 s": put_at("frames", 5, "ts", value=0.1),
    r"\['frames'\] is no list": put_at("frames", value=3),
    "holds no camera: lacks 'fy'": taken_from("meta", "fy"),
    "holds no camera: not a camera": put_at("meta", "fx", value=-1),
    "says 61x80 px, the maps are 80x60": put_at("meta", "res_x", value=61),
    "hold 18 maps, `meta` 19 frames": lambda meta: meta["frames"].append(meta["frames"][-1]),
    "no frame with maps and known motion": lambda meta: [
        entry["cam"]["pos"]["t"].update(x=float("nan")) for entry in meta["full_trajectory"]
    ],
}


@pytest.mark.parametrize("message", SPOILT)
def test_what_is_wrong_in_meta_is_said_with_its_place(tmp_path, message):
    meta = spoilt(SPOILT[message])
    with pytest.raises(BadFile, match=message):
        open_recording(v1_npz(tmp_path / "a.npz", meta=meta))


@pytest.mark.filterwarnings("ignore::evimo.errors.EvimoWarning")
def test_poses_that_are_not_numbers_void_their_frames_only(tmp_path):
    meta = v1_meta()
    for entry in meta["full_trajectory"][70:84]:
        entry["cam"]["pos"]["q"]["w"] = float("nan")
    recording = open_recording(v1_npz(tmp_path / "a.npz", meta=meta))
    assert {350_000, 376_500, 400_000} == set(TIMES_US.tolist()) - set(recording.times_us.tolist())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mask": None}, "lacks `mask`"),
        ({"mask": maps()[1][:, :, :70]}, r"`depth` is \(18, 60, 80\), `mask` is \(18, 60, 70\)"),
        ({"depth": np.zeros((60, 80))}, r"`depth` of .* is \(60, 80\)"),
        ({"depth": np.zeros((18, 60, 80), "U2")}, "`depth` of"),
        ({"meta": np.zeros(3)}, r"`meta` in a\.npz is \(3,\) float64"),
        ({"meta": np.array("{'meta': __import__('os')}")}, "no literal"),
        ({"meta": np.array([1, None], object)}, "`meta` in"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(tmp_path, changes, message):
    with pytest.raises(BadFile, match=message):
        open_recording(v1_npz(tmp_path / "a.npz", **changes))


def test_text_that_is_code_is_not_run_and_its_line_is_named(tmp_path):
    folder = v1_text(tmp_path / "a")
    text = (folder / "meta.txt").read_text()
    lines = text.splitlines()
    lines[2] = "'x': __import__('os').system('touch ran'),"
    (folder / "meta.txt").write_text("\n".join(lines))
    with pytest.raises(BadFile, match=r"meta\.txt, line 3 is no literal"):
        open_recording(folder)
    (folder / "meta.txt").write_text(text[: len(text) // 2])
    with pytest.raises(BadFile, match=r"meta\.txt"):
        open_recording(folder)
    (folder / "meta.txt").write_text(text.replace("0.226", "nan", 1))
    with pytest.raises(BadFile, match="no time"):
        open_recording(folder)


def test_pictures_of_another_kind_are_refused(tmp_path):
    import cv2

    folder = v1_text(tmp_path / "a")
    recording = open_recording(folder)
    picture = folder / "img" / "depth_mask_2.png"
    cv2.imwrite(str(picture), np.zeros((60, 80, 3), np.uint8))
    with pytest.raises(BadFile, match=r"depth_mask_2\.png is no picture of three channels of 16 bits"):
        recording.truth(2)
    picture.unlink()
    assert len(open_recording(folder)) == len(TIMES_US) - 1


def test_a_path_in_meta_leads_nowhere(tmp_path):
    folder = v1_text(tmp_path / "a")
    text = (folder / "meta.txt").read_text()
    (folder / "meta.txt").write_text(text.replace("depth_mask_2.png", "../../secret.png"))
    assert len(open_recording(folder)) == len(TIMES_US) - 1


def test_folders_that_lack_a_file_say_which(tmp_path):
    folder = v2_folder(tmp_path / "a")
    (folder / "dataset_mask.npz").unlink()
    with pytest.raises(BadFile, match=r"lacks dataset_mask\.npz"):
        open_recording(folder)
    (folder / "dataset_info.npz").unlink()
    with pytest.raises(BadFile, match="holds events and no truth"):
        open_recording(folder)


@pytest.mark.parametrize("missing", ["calib.txt", "extrinsics.txt", "config.txt"])
def test_a_bag_without_the_files_beside_it_says_so(tmp_path, missing):
    path = v1_bag(tmp_path / "a")
    path.with_name(missing).unlink()
    with pytest.raises(BadFile, match=f"lacks {missing}"):
        open_recording(path)


def test_a_bag_with_half_a_calibration_names_file_and_line(tmp_path):
    path = v1_bag(tmp_path / "a")
    path.with_name("extrinsics.txt").write_text("0 0 0 0 0 nan\n")
    with pytest.raises(BadFile, match=r"extrinsics\.txt, line 1: 6 numbers"):
        open_recording(path)


def test_meta_as_text_is_read_as_the_pickle_is(tmp_path):
    one = open_recording(v1_npz(tmp_path / "a.npz"))
    for name, words in (("b", json.dumps(v1_meta())), ("c", repr(v1_meta()))):
        two = open_recording(v1_npz(tmp_path / f"{name}.npz", meta=np.array(words)))
        np.testing.assert_array_equal(one.times_us, two.times_us)
        np.testing.assert_array_equal(one.truth(3).ego, two.truth(3).ego)


def test_events_of_a_bag_a_lifetime_later_make_no_frames(tmp_path):
    usual = open_recording(v1_bag(tmp_path / "a")).times_us
    sixty_years_us = 60 * 365 * 86_400_000_000
    later = open_recording(v1_bag(tmp_path / "b", again_us=sixty_years_us)).times_us
    assert later[: len(usual)].tolist() == usual.tolist()
    assert len(later) <= len(usual) + 3  # beside the last poses
