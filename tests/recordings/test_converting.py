"""A recording written in every layout and read back says the same."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from tests.recordings.dataset_files import v1_bag, v1_npz, v2_folder
from tests.recordings.known_scene import CAMERA, events, poses, truth

from evimo.cli import main
from evimo.errors import BadFile
from evimo.events.events import joined
from evimo.recordings.converting import convert_recording
from evimo.recordings.layouts import layout_of
from evimo.recordings.recording import open_recording
from evimo.recordings.writer import RecordingWriter
from evimo.simulate.plan import RecordingPlan
from evimo.simulate.recording import simulate_recording

SUFFIX = {"evimo1": ".npz", "evimo2": "", "hdf5": ".h5"}


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """A film of the simulator, with ids of events and an IMU."""
    path = tmp_path_factory.mktemp("simulated") / "film"
    film = simulate_recording(RecordingPlan(seed=3, set_number=1, seconds=0.3, size=(60, 80)))
    with RecordingWriter(path, film.camera, facts=film.facts(), poses=film.poses, imu=film.imu()) as writer:
        for piece in film:
            writer.write(
                piece.events, piece.truth, clutter_bodies=piece.clutter.astype(np.uint8), event_ids=piece.event_ids
            )
    return path


def same(one, two, *, ids=True, depth_m=0.0):
    np.testing.assert_array_equal(one.times_us, two.times_us)
    assert one.camera == two.camera
    mine, other = joined(list(one.events)), joined(list(two.events))
    for name in ("x", "y", "t", "p"):
        np.testing.assert_array_equal(getattr(mine, name), getattr(other, name))
    if ids:
        np.testing.assert_array_equal(one.event_ids, two.event_ids)
    for k in range(len(one)):
        mine, other = one.truth(k), two.truth(k)
        np.testing.assert_allclose(mine.depth, other.depth, atol=depth_m, rtol=0)
        np.testing.assert_array_equal(mine.ids, other.ids)
        assert mine.objects.keys() == other.objects.keys()
        np.testing.assert_array_equal(mine.ego, other.ego)
        np.testing.assert_array_equal(mine.clutter, other.clutter)
        assert mine.movers == other.movers
        for key, body in mine.objects.items():
            np.testing.assert_array_equal(body.velocity, other.objects[key].velocity)


@pytest.mark.parametrize("layout", SUFFIX)
def test_a_simulated_recording_comes_back_from_every_layout(simulated, tmp_path, layout):
    original = open_recording(simulated)
    path = convert_recording(original, tmp_path / f"film{SUFFIX[layout]}", layout)
    copy = open_recording(path)
    same(original, copy)
    for name, values in original.imu.arrays().items():
        np.testing.assert_array_equal(getattr(copy.imu, name), values)
    assert copy.meta["seed"] == 3
    assert copy.meta["converted_from"] == "film"
    at = np.array([10_000, 123_456])
    np.testing.assert_allclose(copy.paths.poses(at).world_from_cam, original.paths.poses(at).world_from_cam, atol=1e-4)


def test_a_simulated_recording_is_read_as_the_dataset_is_where_nothing_else_is_known(simulated, tmp_path):
    """Without what this package adds, everything comes from `meta`: poses, splines, the principal point's own test."""
    original = open_recording(simulated)
    with np.load(convert_recording(original, tmp_path / "film.npz", "evimo1")) as stored:
        kept = {name: stored[name] for name in stored if not name.startswith("sim_")}
    np.savez(tmp_path / "bare.npz", **kept)
    bare = open_recording(tmp_path / "bare.npz")
    assert layout_of(bare.path) == "EV-IMO npz"
    np.testing.assert_array_equal(original.times_us, bare.times_us)
    for k in range(1, len(bare) - 1):
        mine, other = original.truth(k), bare.truth(k)
        np.testing.assert_array_equal(mine.ids, other.ids)
        np.testing.assert_array_equal(mine.depth, other.depth)
        np.testing.assert_allclose(mine.ego, other.ego, atol=0.02)
        for key, body in mine.objects.items():
            np.testing.assert_allclose(body.velocity, other.objects[key].velocity, atol=0.03)
            np.testing.assert_allclose(body.position, other.objects[key].position, atol=1e-5)


@pytest.mark.parametrize("layout", SUFFIX)
@pytest.mark.parametrize("made", [v1_npz, v2_folder])
def test_a_dataset_comes_back_from_every_layout(tmp_path, layout, made):
    original = open_recording(made(tmp_path / ("seq_00.npz" if made is v1_npz else "seq_00")))
    copy = open_recording(convert_recording(original, tmp_path / f"new{SUFFIX[layout]}", layout))
    same(original, copy, ids=False, depth_m=0.00051)  # EV-IMO's first files hold fractions of a millimetre
    assert copy.event_ids is None
    assert copy.meta["set"] == original.meta["set"]


def test_what_a_layout_cannot_hold_is_refused(tmp_path):
    with pytest.raises(BadFile, match="no maps of truth"):
        convert_recording(open_recording(v1_bag(tmp_path / "bag")), tmp_path / "new", "evimo2")
    with RecordingWriter(tmp_path / "still", CAMERA) as writer:
        writer.write(events(0, 25_000), truth(12_500))
    with pytest.raises(BadFile, match="no poses"):
        convert_recording(open_recording(tmp_path / "still"), tmp_path / "new.npz", "evimo1")
    assert not (tmp_path / "new.npz").exists()


def test_the_command_keeps_folders_and_makes_only_what_is_missing(tmp_path, capsys):
    v1_npz(tmp_path / "in" / "train" / "box" / "npz" / "seq_01.npz")
    v1_npz(tmp_path / "in" / "eval" / "table" / "npz" / "seq.02.npz")
    (tmp_path / "in" / "eval" / "table" / "npz" / "other.npz").write_bytes((tmp_path / "in").name.encode())
    command = ["convert", str(tmp_path / "in"), "--layout", "hdf5", "--out", str(tmp_path / "out")]
    assert main(command) == 2  # a file that is none is said, not passed over
    (tmp_path / "in" / "eval" / "table" / "npz" / "other.npz").unlink()
    assert main(command) == 0
    assert "2 of 2 recordings written" in capsys.readouterr().out
    one = tmp_path / "out" / "train" / "box" / "npz" / "seq_01.h5"
    two = tmp_path / "out" / "eval" / "table" / "npz" / "seq.02.h5"
    before = two.stat().st_mtime_ns
    one.unlink()
    assert main(command) == 0
    assert "1 of 2 recordings written" in capsys.readouterr().out
    assert one.exists() and two.stat().st_mtime_ns == before
    assert main([*command[:-1], str(tmp_path / "some"), "--split", "paper2019"]) == 0
    assert len(list((tmp_path / "some").rglob("*.h5"))) == 2


@pytest.mark.slow
@pytest.mark.parametrize("layout", SUFFIX)
def test_the_bytes_are_the_same_whoever_converts(simulated, tmp_path, layout, capsys):
    for name in ("a", "b"):
        shutil.copytree(simulated, tmp_path / "in" / name)
    command = ["convert", str(tmp_path / "in"), "--layout", layout, "--out"]
    assert main([*command, str(tmp_path / "alone")]) == 0
    assert main([*command, str(tmp_path / "two"), "--workers", "2"]) == 0
    assert capsys.readouterr().out.count("2 of 2 recordings written") == 2
    made, alone = contents(tmp_path / "two"), contents(tmp_path / "alone")
    assert made == alone and {Path(name).parts[0] for name in made} == {f"{name}{SUFFIX[layout]}" for name in "ab"}
    assert main([*command, str(tmp_path / "two"), "--workers", "2"]) == 0
    assert "0 of 2 recordings written" in capsys.readouterr().out


def contents(folder):
    return {str(file.relative_to(folder)): file.read_bytes() for file in sorted(folder.rglob("*")) if file.is_file()}


def test_a_recording_that_does_not_fit_costs_itself_only_and_two_of_one_name_are_refused(tmp_path, capsys):
    with RecordingWriter(tmp_path / "still", CAMERA) as writer:
        writer.write(events(0, 25_000), truth(12_500))
    still, good = tmp_path / "still", v1_npz(tmp_path / "seq_01.npz")
    command = ["convert", str(still), str(good), "--layout", "evimo1", "--out"]
    assert main([*command, str(tmp_path / "out")]) == 2
    assert f"error: {still} holds no poses" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["seq_01.npz"]
    other = v1_npz(tmp_path / "other" / "seq_01.npz")
    assert main(["convert", str(good), str(other), "--out", str(tmp_path / "both")]) == 2
    assert f"{good} and {other} would both be written to" in capsys.readouterr().err


def test_unknown_poses_are_left_out_of_the_words(tmp_path):
    """NaN is no JSON: an object that is lost for a while has no entry there."""

    def lost(times_us):
        track = poses(times_us)
        track.cam_from_object[:, 1] = np.nan
        return track

    with RecordingWriter(tmp_path / "a", CAMERA, poses=lost) as writer:
        writer.write(events(0, 25_000), truth(12_500))
    text = (tmp_path / "a" / "dataset_info.json").read_text()
    (frame,) = json.loads(text, parse_constant=lambda name: pytest.fail(name))["meta"]["frames"]
    assert {"1", "3"} <= frame.keys()
    assert "2" not in frame
