import errno
import json

import av
import h5py
import numpy as np
import pytest

from evimo.errors import BadInput, EvimoWarning
from evimo.events.events import joined
from evimo.streaming.inference import Network
from evimo.streaming.pipeline import Run
from evimo.streaming.saving import Control, Wanted, save_run

ALL = {"egomotion.csv", "objects.csv", "summary.json", "estimates.h5", "video.mp4"}


@pytest.fixture
def prepared(discs, recorded, fake_network, camera):
    return lambda **how: Run(recorded(discs), Network(fake_network), camera=camera, **how)


def images_in(path) -> int:
    with av.open(str(path)) as container:
        return sum(1 for _ in container.decode(video=0))


def rows_in(path) -> list[str]:
    return path.read_text().splitlines()[1:]


def test_all_outputs_speak_of_the_same_slices(prepared, tmp_path):
    run = prepared()
    saved = save_run(run, tmp_path, Wanted(dense=True, video_speed=0.25), settings={"start_s": 0.0})
    assert {path.name for path in saved.files} == {path.name for path in tmp_path.iterdir()} == ALL
    summary = json.loads((tmp_path / "summary.json").read_text())
    count = summary["slices"]
    assert count == len(run.span) == 20
    assert summary == json.loads(json.dumps(saved.summary))
    assert images_in(tmp_path / "video.mp4") == count
    ego, objects = rows_in(tmp_path / "egomotion.csv"), rows_in(tmp_path / "objects.csv")
    with h5py.File(tmp_path / "estimates.h5") as maps:
        assert maps["t_us"][:].tolist() == [int(row.split(",")[0]) for row in ego]
        times, ids = maps["t_us"][:].tolist(), maps["ids"][:]
    in_maps = {
        (t_us, int(number)): int(count)
        for t_us, image in zip(times, ids, strict=True)
        for number, count in zip(*np.unique(image[image > 0], return_counts=True), strict=True)
    }
    in_table = {(int(row[0]), int(row[1])): int(row[6]) for row in (line.split(",") for line in objects)}
    assert in_table == in_maps


def test_labelled_events_are_those_of_the_slices(prepared, tmp_path, discs):
    run = prepared(event_labels=True)
    save_run(run, tmp_path, Wanted(dense=False, video_speed=None))
    first, last = run.span.first * 25_000, run.span.last * 25_000
    with h5py.File(tmp_path / "events.h5") as saved:
        expected = discs.between(first, last)
        for name, column in (("t_us", expected.t), ("x", expected.x), ("y", expected.y), ("p", expected.p)):
            np.testing.assert_array_equal(saved[name], column)
        in_table = {int(row.split(",")[1]) for row in rows_in(tmp_path / "objects.csv")}
        assert set(np.unique(saved["object"]).tolist()) - {0} <= in_table
        assert (saved["object"][:] > 0).mean() > 0.5  # all events are on one of the two discs


def test_the_summary_says_what_was_done(prepared, tmp_path):
    run = prepared()
    control = Control(warnings=["mind the gap"])
    save_run(run, tmp_path, Wanted(dense=False, video_speed=None), settings={"start_s": 0.0}, control=control)
    assert {path.name for path in tmp_path.iterdir()} == ALL - {"estimates.h5", "video.mp4"}
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["model"]["sha256"] == run.network.sha256
    assert summary["model"]["config"] == {"hidden": 8}
    assert summary["settings"] == {"dense": False, "video_speed": None, "start_s": 0.0}
    assert summary["camera"]["fx"] == 24
    assert summary["camera"]["source"] == "given"
    assert summary["rotation"] == "the recording has no gyroscope"
    assert summary["invalid_pixels"] == 0
    assert set(summary["dropped_events"].values()) == {0}
    assert set(summary["dropped_events"]) == {"without_place_in_image", "late", "outlying", "after_reset", "off_sensor"}
    assert summary["warnings"] == ["mind the gap"]
    assert summary["objects_seen"] == 2
    assert summary["slices_per_s"] > 0
    assert {"reading", "placing", "first pass", "second pass", "objects", "tables"} <= set(summary["stages_ms"])
    assert summary["interrupted"] is False
    assert {"evimo", "onnxruntime", "python"} <= set(summary["versions"])


def test_a_fast_video_leaves_out_slices_and_keeps_its_speed(prepared, tmp_path):
    save_run(prepared(), tmp_path, Wanted(dense=False, video_speed=4.0))
    with av.open(str(tmp_path / "video.mp4")) as container:
        fps = container.streams.video[0].average_rate
    images = images_in(tmp_path / "video.mp4")
    assert fps <= 60
    assert images / fps == pytest.approx(0.5 / 4, rel=0.1)


class StopAfter(Control):
    def __init__(self, slices: int) -> None:
        super().__init__()
        self.left = slices

    def finished_slice(self) -> None:
        self.left -= 1
        self.stopped = self.left <= 0


def test_a_stopped_run_is_complete_up_to_there(prepared, tmp_path):
    saved = save_run(prepared(), tmp_path, Wanted(dense=True, video_speed=0.25), control=StopAfter(7))
    assert {path.name for path in tmp_path.iterdir()} == ALL
    assert saved.summary["interrupted"] is True
    assert saved.summary["slices"] == len(rows_in(tmp_path / "egomotion.csv")) == images_in(tmp_path / "video.mp4") == 7
    with h5py.File(tmp_path / "estimates.h5") as maps:
        assert len(maps["t_us"]) == len(maps["ids"]) == 7


def test_a_stopped_run_labels_the_events_up_to_there(prepared, tmp_path, discs):
    run = prepared(event_labels=True)
    save_run(run, tmp_path, Wanted(dense=False, video_speed=None), control=StopAfter(7))
    with h5py.File(tmp_path / "events.h5") as saved:
        first = run.span.first
        assert len(saved["object"]) == len(discs.between(first * 25_000, (first + 7) * 25_000))


def test_stopped_before_the_first_slice_leaves_nothing(prepared, tmp_path):
    control = Control()
    control.stopped = True
    run = prepared(event_labels=True)
    assert save_run(run, tmp_path / "out", Wanted(dense=True, video_speed=None), control=control) is None
    assert not (tmp_path / "out").exists()


def test_outputs_of_an_earlier_run_that_stay_are_said(prepared, tmp_path):
    save_run(prepared(event_labels=True), tmp_path, Wanted(dense=True, video_speed=None))
    with pytest.warns(EvimoWarning) as caught:
        save_run(prepared(), tmp_path, Wanted(dense=False, video_speed=None))
    told = "\n".join(str(each.message) for each in caught)
    for name in ("estimates.h5", "events.h5"):
        assert f"{name} is from an earlier run" in told
        assert (tmp_path / name).exists()


@pytest.mark.parametrize("dense", [True, False])
def test_a_full_disk_is_our_error(prepared, tmp_path, monkeypatch, dense):
    def fail(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    place = "estimates_file.EstimatesFile._put" if dense else "tables.Tables.write"
    monkeypatch.setattr(f"evimo.streaming.{place}", fail)
    with pytest.raises(BadInput, match=r"cannot write .*: No space left on device"):
        save_run(prepared(), tmp_path / "out", Wanted(dense=dense, video_speed=None))
    assert not (tmp_path / "out").exists()


def test_a_failure_keeps_the_old_outputs(prepared, tmp_path):
    save_run(prepared(), tmp_path, Wanted(dense=False, video_speed=None))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    run = prepared(event_labels=True)
    read = run.events.read

    def broken(start_us):
        yield next(read(start_us)).part(0, 3000)
        raise OSError("the cable was pulled")

    run.events.read = broken
    with pytest.raises(OSError, match="cable"):
        save_run(run, tmp_path, Wanted(dense=True, video_speed=0.25))
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_the_files_say_which_slices_have_no_events(discs, recorded, fake_network, camera, tmp_path):
    """A camera that sees nothing does not rest: its motion is empty in the table, and no number in the maps."""
    begin = (int(discs.t[0]) // 25_000 + 5) * 25_000
    at, till = np.searchsorted(discs.t, (begin, begin + 50_000)).tolist()
    silent = joined([discs.part(0, at), discs.part(till, len(discs))])
    run = Run(recorded(silent), Network(fake_network), camera=camera, event_labels=True)
    saved = save_run(run, tmp_path, Wanted(dense=True, video_speed=1.0))
    rows = rows_in(tmp_path / "egomotion.csv")
    empty = [row.partition(",")[0] for row in rows if row.endswith(",,,,,,")]
    assert empty == [str(begin + 12_500), str(begin + 37_500)]
    assert saved.summary["slices_without_events"] == 2
    with h5py.File(tmp_path / "estimates.h5") as maps:
        silent = ~maps["has_events"][:]
        assert maps["t_us"][:][silent].tolist() == [int(each) for each in empty]
        assert (np.isnan(maps["ego"][:]).all(axis=1) == silent).all()
