import itertools

import numpy as np
import pytest

from evimo.cli.simulate import simulate
from evimo.errors import BadInput
from evimo.recordings.recording import open_recording
from evimo.simulate.dataset import DatasetPlan, simulate_dataset

PLAN = DatasetPlan(set_number=0, minutes=0.15 / 60, seed=40, seconds=0.05, size=(33, 44))


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


def test_stopping_leaves_complete_recordings_only(tmp_path):
    first = next(iter(simulate_dataset(PLAN, tmp_path)))
    assert list(tmp_path.iterdir()) == [first]
    resumed = simulate_dataset(PLAN, tmp_path)
    assert next(iter(resumed)) == first
    assert len(list(itertools.islice(resumed, 1))) == 1


@pytest.mark.slow
def test_processes_write_the_same_bytes(tmp_path):
    alone = list(simulate_dataset(PLAN, tmp_path / "alone"))
    list(simulate_dataset(PLAN, tmp_path / "together", workers=2))
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
    ],
)
def test_bad_requests_say_what_would_do(how, message, tmp_path):
    with pytest.raises(BadInput, match=message):
        simulate(**{"minutes": 1.0, "out": tmp_path, **how})
