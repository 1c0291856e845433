import itertools
import json
import warnings
from dataclasses import replace

import numpy as np
import pytest

from evimo.cli import main
from evimo.cli.simulate import simulate
from evimo.errors import BadFile, BadInput, EvimoWarning
from evimo.events.events import joined, no_events
from evimo.formats import open_events
from evimo.jobs.crew import Crew
from evimo.recordings.recording import open_recording
from evimo.simulate.dataset import DatasetPlan, simulate_dataset
from evimo.simulate.pixels import Pixels
from evimo.simulate.plan import RecordingPlan

FIRST = RecordingPlan(seed=40, set_number=5, seconds=0.05, size=(33, 44))
PLAN = DatasetPlan(first=FIRST, minutes=0.15 / 60, every_set=True)


def of(plan, **how):
    """The plan with other recordings."""
    return replace(plan, first=replace(plan.first, **how))


def test_a_plan_is_carried_out_and_not_twice(tmp_path):
    folders = list(simulate_dataset(PLAN, tmp_path))
    assert sorted(folder.name for folder in folders) == ["set1_000042", "set5_000040", "set6_000041"]
    before = {file: file.stat().st_mtime_ns for folder in folders for file in folder.iterdir()}
    assert sorted(simulate_dataset(PLAN, tmp_path)) == sorted(folders)
    assert {file: file.stat().st_mtime_ns for folder in folders for file in folder.iterdir()} == before
    recording = open_recording(folders[0])
    assert recording.meta["seed"] == 40
    assert recording.meta["sensor"]["contrast"] > 0
    assert recording.camera.size == (33, 44)
    assert len(recording) == 2
    assert recording.truth(1).depth.max() > 0.3


@pytest.mark.parametrize("layout", ["evimo2", "evimo1"])
def test_what_is_there_and_was_made_otherwise_is_refused(layout, tmp_path):
    plan = replace(PLAN, minutes=0.05 / 60, layout=layout)
    (recording,) = simulate_dataset(plan, tmp_path)
    more = replace(plan, minutes=0.1 / 60)
    for other, words in (
        ({"size": (34, 44)}, "size 44x33 instead of size 44x34"),
        ({"size": None}, "size 44x33 instead of size 346x260"),
        ({"sensor": "samsung"}, "sensor davis346 instead of sensor samsung"),
        ({"camera": "evimo"}, "camera random instead of camera evimo"),
        ({"seconds": 0.025}, "seconds 0.05 instead of seconds 0.025"),
    ):
        with pytest.raises(BadInput, match=f"(?s){recording}.*{words}.*another --out than {tmp_path}"):
            next(simulate_dataset(of(more, **other), tmp_path))
    assert list(tmp_path.iterdir()) == [recording]
    assert next(simulate_dataset(more, tmp_path)) == recording


def test_recordings_of_before_there_were_sensors_are_of_a_davis346(tmp_path):
    plan = replace(PLAN, minutes=0.05 / 60)
    (recording,) = simulate_dataset(plan, tmp_path)
    path = recording / "dataset_info.json"
    stored = json.loads(path.read_text())
    del stored["evimo"]["sensor_kind"]
    path.write_text(json.dumps(stored))
    assert list(simulate_dataset(plan, tmp_path)) == [recording]
    with pytest.raises(BadInput, match="sensor davis346 instead of sensor gen4"):
        next(simulate_dataset(of(plan, sensor="gen4"), tmp_path))
    path.unlink()
    with pytest.raises(BadFile, match=r"lacks dataset_info\.json"):
        next(simulate_dataset(plan, tmp_path))


def test_stopping_leaves_complete_recordings_only(tmp_path):
    first = next(iter(simulate_dataset(PLAN, tmp_path)))
    assert list(tmp_path.iterdir()) == [first]
    resumed = simulate_dataset(PLAN, tmp_path)
    assert next(iter(resumed)) == first
    assert len(list(itertools.islice(resumed, 1))) == 1


@pytest.mark.parametrize("layout", ["evimo2", "evimo1"])
def test_events_alone_are_added_to_recordings_that_are_there(layout, tmp_path):
    plan = replace(PLAN, minutes=0.05 / 60, layout=layout)
    (recording,) = simulate_dataset(plan, tmp_path)
    written = recording.stat().st_mtime_ns
    assert list(simulate_dataset(replace(plan, events="aedat4"), tmp_path)) == [recording]
    alone = tmp_path / "set5_000040.aedat4"
    assert {path.name for path in tmp_path.iterdir()} == {recording.name, alone.name}
    assert recording.stat().st_mtime_ns == written
    once = alone.stat().st_mtime_ns
    assert list(simulate_dataset(replace(plan, events="aedat4"), tmp_path)) == [recording]
    assert alone.stat().st_mtime_ns == once
    with warnings.catch_warnings():
        warnings.simplefilter("error", EvimoWarning)
        one, two = joined(list(open_events(recording))), joined(list(open_events(alone)))
    for name in ("x", "y", "t", "p"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))


def test_a_recording_without_events_has_a_file_of_none(tmp_path, monkeypatch):
    monkeypatch.setattr(Pixels, "events", lambda *_: no_events())
    for layout in ("evimo2", "evimo1"):
        plan = replace(PLAN, minutes=0.05 / 60, layout=layout, events="raw")
        (recording,) = simulate_dataset(plan, tmp_path / layout)
        assert recording.exists()
        assert (tmp_path / layout / "set5_000040.raw").read_bytes().endswith(b"% end\n")


def test_stopping_leaves_no_half_file_of_the_first_layout(tmp_path):
    plan = replace(PLAN, layout="evimo1")
    first = next(iter(simulate_dataset(plan, tmp_path)))
    assert list(tmp_path.iterdir()) == [first]
    assert first.name == "set5_000040.npz"
    resumed = list(simulate_dataset(plan, tmp_path))
    assert [path.name for path in resumed] == ["set5_000040.npz", "set6_000041.npz", "set1_000042.npz"]


@pytest.mark.slow
def test_processes_write_the_same_bytes(tmp_path):
    alone = list(simulate_dataset(PLAN, tmp_path / "alone"))
    list(simulate_dataset(PLAN, tmp_path / "together", crew=Crew(workers=2)))
    for folder in alone:
        for file in folder.iterdir():
            assert file.read_bytes() == (tmp_path / "together" / folder.name / file.name).read_bytes()


def test_the_command_writes_recordings(tmp_path):
    simulate(set="3", minutes=0.05 / 60, seed=9, out=tmp_path, size="44x33", seconds=0.05, camera="evimo")
    recording = open_recording(tmp_path / "set3_000009")
    assert recording.camera.size == (33, 44)
    assert recording.camera.fx == pytest.approx(257.68 * 44 / 346, rel=1e-4)
    assert np.isfinite(recording.truth(0).ego).all()


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({"set": "7"}, "from 1 to 6"),
        ({"set": "12"}, "from 1 to 6"),
        ({"size": "346"}, "WxH"),
        ({"size": "4x4"}, "16x16"),
        ({"minutes": 0.0}, "positive"),
        ({"seed": -1}, "seed"),
        ({"seconds": 0.0}, "0.025"),
        ({"seconds": 0.06}, "multiple of 0.025"),
        ({"crew": Crew(workers=0)}, "at least one"),
        ({"sensor": "kodak"}, "davis346"),
        ({"layout": "coco"}, "evimo2, evimo1"),
        ({"events": "dat"}, "aedat4, raw"),
        ({"events": "raw", "size": "2049x16"}, "2048"),
    ],
)
def test_bad_requests_say_what_would_do(how, message, tmp_path):
    with pytest.raises(BadInput, match=message):
        simulate(**{"minutes": 1.0, "out": tmp_path / "out", **how})
    assert not list(tmp_path.iterdir())


def test_the_command_takes_layout_events_and_sensor(tmp_path, capsys):
    command = ["simulate", "--set", "3", "--minutes", "0.0005", "--seconds", "0.025", "--out", str(tmp_path)]
    choices = ["--sensor", "samsung", "--size", "44x33", "--layout", "evimo1", "--events", "raw"]
    assert main([*command, *choices]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"set3_000000.npz", "set3_000000.raw"}
    assert main([*command, *choices[2:]]) == 2  # the sensor is another one now
    said = capsys.readouterr().err.splitlines()
    assert said[0].startswith(f"error: {tmp_path / 'set3_000000.npz'} is there already")
    assert said[1] == f"  try: another --out than {tmp_path}, or ask for sensor samsung again"
    for wrong in (["--sensor", "kodak"], ["--layout", "coco"], ["--events", "dat"]):
        assert main([*command, *wrong]) == 2
        assert "Traceback" not in "".join(capsys.readouterr())


def test_no_workers_are_refused(tmp_path, capsys):
    with pytest.raises(BadInput, match="0 workers"):
        list(simulate_dataset(PLAN, tmp_path, crew=Crew(workers=0)))
    assert main(["simulate", "--minutes", "0.001", "--workers", "-1", "--out", str(tmp_path / "a")]) == 2
    assert "-1 workers" in capsys.readouterr().err
