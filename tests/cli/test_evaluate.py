"""`evimo evaluate` on recordings made by hand, with a model that knows the truth."""

import json
import os
import shutil
import sys
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from pytest import approx

from evimo.cli import main
from evimo.errors import NotFound
from evimo.evaluation.report import MODEL, load_report
from evimo.evaluation.scoring import labelled_estimates
from evimo.events.events import Events
from evimo.geometry.camera import Camera
from evimo.recordings.estimate import Estimate
from evimo.recordings.evimo1_writer import Evimo1Writer
from evimo.recordings.finding import recordings_in
from evimo.recordings.flow import true_flow
from evimo.recordings.pose_track import PoseTrack
from evimo.recordings.recording import Recording, open_recording
from evimo.recordings.truth import ObjectTruth, Truth
from evimo.recordings.writer import RecordingWriter
from evimo.writing import MARKER

CAMERA = Camera(fx=40.0, fy=40.0, cx=19.5, cy=14.5, height=30, width=40)
EGO = np.array([0.3, 0, 0.4, 0, 0.2, 0])
SLICES = 3


def truth_at(t_us: int) -> Truth:
    """A wall at 2 m with a patch of clutter, and a square of 10x10 pixels at 1 m that moves 0.2 m/s to the right."""
    ids, clutter = np.zeros(CAMERA.size, np.uint8), np.zeros(CAMERA.size, bool)
    ids[10:20, 10:20] = 1
    clutter[0:5, 30:40] = True
    depth = np.where(ids == 1, 1.0, 2.0).astype(np.float32)
    mover = ObjectTruth(np.array([0, 0, 1.0]), np.array([0.2, 0, 0]), np.zeros(3))
    return Truth(t_us, depth, np.ones(CAMERA.size, bool), ids, clutter, EGO, {1: mover})


def events_in(k: int) -> Events:
    """One event per pixel, spread over slice k."""
    y, x = (each.ravel() for each in np.mgrid[: CAMERA.height, : CAMERA.width])
    t = k * 25_000 + np.linspace(0, 24_999, len(x)).astype(np.int64)
    return Events(x.astype(np.uint16), y.astype(np.uint16), t, np.ones(len(x), np.int8))


def at_rest(times_us):
    still = np.tile(np.eye(4), (len(times_us), 1, 1))
    return PoseTrack(times_us, still, np.array([1], np.uint8), still[:, None])


def save_recording(folder: Path, writes: type[RecordingWriter] | type[Evimo1Writer] = RecordingWriter) -> Path:
    with writes(folder, CAMERA, facts={"set": 4, "seed": 0}, poses=at_rest) as writer:
        for k in range(SLICES):
            events, truth = events_in(k), truth_at(k * 25_000 + 12_500)
            writer.write(events, truth, event_ids=np.roll(truth.ids, k, axis=1)[events.y, events.x])  # k px further
    return folder


def all_knowing(recording: Recording) -> Iterator[Estimate]:
    """What a perfect model says: all velocities and depths in units of 2 m, but no object velocity."""
    height, width = CAMERA.size
    grid = (np.mgrid[:height, :width][::-1] - np.array([[[19.5]], [[14.5]]])) / 40
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


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Replaces the networks by the truth; lists the recordings that were run."""
    done: list[Path] = []

    def prepared(events, network, *, camera, imu):
        assert imu == "off"  # unless told otherwise
        done.append(events.path)
        return all_knowing(open_recording(events.path))

    fakes = {"Run": prepared, "estimates_of": iter, "model_of": lambda name: SimpleNamespace(identity={"sha256": name})}
    for name, fake in fakes.items():
        monkeypatch.setattr(f"evimo.streaming.evaluating.{name}", fake)
    return done


@pytest.fixture
def recordings(tmp_path: Path) -> Path:
    for name in ("b", "a"):
        save_recording(tmp_path / "set" / name)
    return tmp_path / "set"


def test_a_perfect_model_is_perfect_and_the_trivial_answers_are_not(runs, recordings, tmp_path, capsys):
    assert main(["evaluate", str(recordings), "--out", str(tmp_path / "out")]) == 0
    report = load_report(tmp_path / "out" / "report.json")
    assert report.counts["recordings"] == 2
    assert report.counts["slices"] == 2 * SLICES
    for name in ("iou", "iou_pooled", "event_iou", "recall", "delta_1"):
        assert report.value(MODEL, name) == approx(1), name
    for name in ("clutter", "flow", "camera_aee", "camera_aee_depth", "camera_rre", "direction", "abs_rel"):
        assert report.value(MODEL, name) == approx(0, abs=2e-3), name
    assert report.value(MODEL, "event_iou_own") == approx((100 + 90 + 80) / (100 + 110 + 120))  # ids are k px further
    assert report.value(MODEL, "object_aee") == approx(0.2)  # it says nothing of objects
    assert report.value("everything moves", "event_iou") == approx(100 / 1200)
    assert report.value("true flow", "iou") == 0  # 0.2 m/s, 1 m away, seen by 40 px: 0.2 px a slice, below 0.3
    assert report.value("zero twist", "camera_aee") == approx(0.5)
    assert report.value("zero twist", "camera_rre") == approx(0.2)
    assert report.value("one depth everywhere", "abs_rel") == approx(100 / 1200)
    printed = capsys.readouterr().out
    assert "recordings: overview" in printed and "beats zero flow" in printed
    page = (tmp_path / "out" / "report.md").read_text()
    assert "| model, set 4 | 1.000 |" in page and "event density, oracle threshold" in page


def test_flow_of_zero_motion_is_what_the_camera_geometry_says(runs, recordings, tmp_path):
    main(["evaluate", str(recordings / "a"), "--out", str(tmp_path / "out")])
    truth = truth_at(12_500)
    lengths = []
    for y, x in np.ndindex(CAMERA.size):  # move the camera for a millisecond and look again
        z = float(truth.depth[y, x])
        point = np.array([(x - 19.5) / 40 * z, (y - 14.5) / 40 * z, z])
        after = point - (EGO[:3] + np.cross(EGO[3:], point)) * 1e-3 + (truth.ids[y, x] == 1) * np.array([0.2e-3, 0, 0])
        lengths.append(np.hypot(*(40 * (after[:2] / after[2] - point[:2] / point[2]))) / 1e-3)
    zero = load_report(tmp_path / "out" / "report.json").value("zero flow", "flow_dense")
    assert zero == approx(np.mean(lengths), rel=1e-2)


def test_events_keep_their_own_ids_where_estimates_begin_later(recordings):
    recording = open_recording(recordings / "a")
    samples = [sample for _, sample in labelled_estimates(recording, islice(all_knowing(recording), 1, None))]
    assert len(samples) == SLICES - 1
    for k, sample in enumerate(samples, 1):
        assert set(sample.events.x[sample.event_ids == 1].tolist()) == set(range(10 + k, 20 + k))


def test_recordings_scored_before_are_not_scored_again(runs, recordings, tmp_path):
    command = ["evaluate", str(recordings), "--out", str(tmp_path / "out")]
    main(command)
    first = (tmp_path / "out" / "report.json").read_text()
    assert [path.name for path in runs] == ["a", "b"]
    main(command)
    assert len(runs) == 2
    assert (tmp_path / "out" / "report.json").read_text() == first
    next((tmp_path / "out" / "recordings").glob("a-*.json")).write_text("{")  # cut short by a crash
    main(command)
    assert [path.name for path in runs] == ["a", "b", "a"]
    main([*command, "--model", "other.onnx"])
    assert len(runs) == 5
    main([*command, "--model", "other.onnx", "--density-threshold", "1.5"])
    assert len(runs) == 7
    assert json.loads((tmp_path / "out" / "report.json").read_text())["settings"]["density threshold"] == 1.5


@pytest.mark.skipif(sys.platform != "linux", reason="others have no names that are not UTF-8")
def test_a_name_that_is_no_utf8_is_scored_and_kept_as_any(runs, recordings, tmp_path, capsys):
    place = tmp_path / os.fsdecode(b"K\xfcche")
    (recordings / "a").rename(place)
    for _ in range(2):
        assert main(["evaluate", str(place), "--out", str(tmp_path / "out")]) == 0
        assert len(runs) == 1
        assert load_report(tmp_path / "out" / "report.json").counts["slices"] == SLICES


def test_another_recording_at_the_place_of_one_scored_before_is_scored(runs, recordings, tmp_path):
    command = ["evaluate", str(recordings), "--out", str(tmp_path / "out")]
    main(command)
    info = recordings / "a" / "dataset_info.json"
    info.write_text(info.read_text().replace('"seed": 0', '"seed": 1'))
    main(command)
    assert [path.name for path in runs] == ["a", "b", "a"]


def test_a_recording_whose_truth_has_changed_is_scored_anew(runs, recordings, tmp_path):
    """As many instants, events and facts as before."""
    command = ["evaluate", str(recordings), "--out", str(tmp_path / "out")]
    main(command)
    mask = recordings / "b" / "dataset_mask.npz"
    with np.load(mask) as maps:
        emptied = {name: np.zeros_like(maps[name]) for name in maps.files}
    np.savez_compressed(mask, **emptied)
    main(command)
    assert [path.name for path in runs] == ["a", "b", "b"]


def test_a_file_in_the_place_of_another_is_another_recording(tmp_path):
    file = save_recording(tmp_path / "c.npz", Evimo1Writer)
    first, content = open_recording(file).mark, file.read_bytes()
    assert open_recording(file).mark == first
    file.unlink()
    file.write_bytes(content)
    assert open_recording(file).mark != first


def test_files_in_the_layout_of_ev_imo_score_as_folders_do(runs, recordings, tmp_path):
    file = save_recording(tmp_path / "v1" / "c.npz", Evimo1Writer)
    (tmp_path / "v1" / f"{MARKER}d").mkdir()
    shutil.copy(file, tmp_path / "v1" / f"{MARKER}d" / "d.npz")
    np.savez(tmp_path / "v1" / "other.npz", x=np.zeros(3))
    assert recordings_in([recordings, tmp_path / "v1", file]) == [recordings / "a", recordings / "b", file]
    for name, path in (("v2", recordings / "a"), ("v1", file)):
        assert main(["evaluate", str(path), "--out", str(tmp_path / name / "out")]) == 0
    reports = [load_report(tmp_path / name / "out" / "report.json") for name in ("v1", "v2")]
    assert reports[0].rows == reports[1].rows


def test_each_recording_counts_once_however_it_is_named(recordings):
    assert recordings_in([recordings, recordings / "b"]) == [recordings / "a", recordings / "b"]


def test_unfinished_recordings_are_passed_over(recordings):
    (recordings / "a").rename(recordings / f"{MARKER}a")
    assert recordings_in([recordings]) == [recordings / "b"]


def test_a_folder_without_recordings_is_one_error(tmp_path, capsys):
    assert main(["evaluate", str(tmp_path)]) == 2
    assert "no recording with truth in" in capsys.readouterr().err
    with pytest.raises(NotFound, match="no recording given"):
        recordings_in([])


def test_a_model_that_is_not_there_is_one_error(recordings, capsys):
    assert main(["evaluate", str(recordings), "--model", "nowhere.onnx"]) == 2
    assert "no model 'nowhere.onnx'" in capsys.readouterr().err
    forgotten = ["evaluate", str(recordings), "--model", ""]  # as of a variable that a script did not set
    assert main(forgotten) == main([*forgotten, "--without-truth"]) == 2


def test_the_classical_method_is_named_by_its_parameters_and_needs_no_weights(
    recordings, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr("evimo.streaming.graphs.presets", dict)
    out = tmp_path / "out"
    assert main(["evaluate", str(recordings), "--model", "classical", "--out", str(out)]) == 0
    report = load_report(out / "report.json")
    assert report.counts["slices"] == 2 * SLICES
    assert report.settings["model"] == "classical"
    assert "threshold" in str(report.settings["model parameters"])
    assert not any("sha256" in key for key in report.settings)
    assert "classical" in (out / "report.md").read_text()


def test_what_the_rival_does_not_estimate_is_a_dash(recordings, tmp_path, capsys):
    """From a run, and from the files that a run leaves."""
    out = tmp_path / "out"
    assert main(["evaluate", str(recordings), "--model", "ecn", "--out", str(out)]) == 0
    report = load_report(out / "report.json")
    assert report.value("model", "iou") is report.value("model", "object_aee") is None
    assert report.value("model", "abs_rel") > 0 and report.value("model", "camera_rre") > 0
    lines = (out / "report.md").read_text().splitlines()
    overview = next(line for line in lines if line.startswith("| model |"))
    assert overview.split("|")[2:4] == [" – ", " – "]


def test_an_event_file_is_checked_without_truth(fake_network, recording, tmp_path, capsys):
    command = ["evaluate", str(recording), "--without-truth", "--sensor", "32x24", "--model", str(fake_network)]
    assert main([*command, "--out", str(tmp_path / "out")]) == 0
    report = load_report(tmp_path / "out" / "report.json")
    assert report.value("zero flow", "warp_gain") in (1, None)
    assert 0 <= report.rows[MODEL]["called_moving"].value <= 1
    assert "without truth" in capsys.readouterr().out


def test_of_the_rival_flow_alone_is_checked_without_truth(recording, capsys):
    assert main(["evaluate", str(recording), "--without-truth", "--sensor", "32x24", "--model", "ecn"]) == 0
    assert "without truth" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "fix"),
    [
        (["--without-truth", "--imu", "auto"], "leave them out"),
        (["--without-truth", "--truth", "x"], "leave them out"),
        (["--time-unit", "us"], "--without-truth"),
        (["--calibration", "camera.yaml"], "--without-truth"),
        (["--without-truth"], "evimo evaluate RECORDING"),
    ],
)
def test_options_of_one_way_to_score_are_refused_with_another(options, fix, capsys):
    recordings = [] if options == ["--without-truth"] else ["somewhere"]
    assert main(["evaluate", *recordings, *options]) == 2
    assert fix in capsys.readouterr().err
