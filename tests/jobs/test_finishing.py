"""Jobs done by this process and by several: the same results, errors and warnings, whoever dies."""

import os
import signal
import subprocess
import sys
import time
import warnings
from functools import partial
from pathlib import Path

import pytest

from evimo.errors import BadFile, BadInput, EvimoError, EvimoWarning
from evimo.jobs.crew import ALONE, Crew
from evimo.jobs.finishing import finished

pytestmark = [pytest.mark.usefixtures("importable"), pytest.mark.skipif(sys.platform != "linux", reason="kills")]
TWO = Crew(workers=2)


def work(name: str, *before):
    import made_up_work

    function = getattr(made_up_work, name)
    return partial(function, *before) if before else function


def done(function, jobs, crew=TWO, shared=Path(), name=str):
    return list(finished(function, jobs, crew=crew, shared=shared, name=name))


@pytest.mark.parametrize("crew", [ALONE, TWO])
def test_every_job_is_done_once(crew):
    assert sorted(done(work("squared"), range(7), crew)) == [0, 1, 4, 9, 16, 25, 36]
    assert done(work("squared"), [], crew) == []


def test_processes_share_the_cores_and_work_in_the_folder_of_this_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("NUMBA_NUM_THREADS", "6")
    found = done(work("where", Path("some")), range(8), Crew(workers=2))
    assert {each[1:] for each in found} == {(str(tmp_path / "some"), 3)}
    assert os.getpid() not in {each[0] for each in found} and len({each[0] for each in found}) <= 2


def test_processes_are_deaf_to_ctrl_c_from_their_beginning(monkeypatch, capfd):
    """A terminal sends it to them as well, and they would tell of it while they import what they need."""
    usual = subprocess.Popen

    def interrupted(*of, **how):
        process = usual(*of, **how)
        process.send_signal(signal.SIGINT)
        return process

    monkeypatch.setattr(subprocess, "Popen", interrupted)
    with warnings.catch_warnings():
        warnings.simplefilter("error", EvimoWarning)
        assert sorted(done(work("squared"), range(3))) == [0, 1, 4]
    assert "Traceback" not in capfd.readouterr().err


def test_a_process_that_is_killed_costs_its_job_only_and_it_is_done_again(tmp_path):
    with pytest.warns(EvimoWarning, match="the recording 1: its process was ended from outside, and it was made again"):
        found = done(work("dies_once", tmp_path), range(4), name=lambda job: f"the recording {job}")
    assert sorted(found) == [0, 1, 2, 3]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["0", "1", "2", "3", "died"]


def test_a_job_that_kills_every_process_is_an_error_that_names_it():
    with pytest.raises(EvimoError, match=r"(?s)the recording 1: 3 processes were ended from outside.*fewer --workers"):
        done(work("dies"), range(3), name=lambda job: f"the recording {job}")


@pytest.mark.parametrize("crew", [ALONE, TWO])
def test_a_broken_file_costs_its_own_recording(crew):
    found = []
    with pytest.raises(BadFile) as caught:
        found += finished(work("fails"), ["a", "broken.raw", "b"], crew=crew, shared=Path(), name=str)
    assert caught.value.problem == "broken.raw ends early"
    with pytest.raises(BadFile, match=r"^here/broken: the file ends early\n  try: copy it again"):
        done(work("fails"), ["broken"], crew, name=lambda job: f"here/{job}")


def test_the_others_are_finished_before_a_broken_file_is_told():
    results = finished(work("fails"), ["broken.raw", "a", "cut.raw", "b"], crew=ALONE, shared=Path(), name=str)
    assert [next(results), next(results)] == ["a", "b"]
    with pytest.raises(EvimoError, match=r"2 of 4 failed: broken.raw ends early; cut.raw ends early\n  try: copy it"):
        next(results)


@pytest.mark.parametrize("crew", [ALONE, TWO])
def test_any_other_error_ends_all(crew):
    with pytest.raises(BadInput, match="the disk is full"):
        done(work("fails"), ["disk", *map(str, range(50))], crew)


def test_a_bug_in_a_process_keeps_its_traceback():
    with pytest.raises(ZeroDivisionError, match="ours") as caught:
        done(work("fails"), ["bug"])
    assert "made_up_work.py" in caught.value.__notes__[0]
    with pytest.raises(RuntimeError, match=r"(?s)made_up_work\.py.*Unpackable"):
        done(work("fails"), ["odd bug"])


@pytest.mark.parametrize("crew", [ALONE, TWO])
def test_warnings_arrive_with_the_name_of_the_recording(crew):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert done(work("fails"), ["guess"], crew, name=lambda job: "a.raw") == ["guess"]
    assert [str(each.message) for each in caught] == ["a.raw: the camera is guessed"]


@pytest.mark.parametrize("crew", [ALONE, TWO])
def test_what_many_recordings_warn_of_is_told_of_three_and_counted(crew):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert len(done(work("fails"), ["guess", "fine", *["guess"] * 4], crew, name=lambda job: "a.raw")) == 6
    assert [str(each.message) for each in caught] == [
        *["a.raw: the camera is guessed"] * 3,
        "2 more recordings: the camera is guessed",
    ]


def test_stopping_breaks_off_what_is_under_way_and_leaves_nothing(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        _stopped_when(lambda: len(list(tmp_path.glob("pid*"))) == 2, work("endless", tmp_path))
    pids = [int(path.read_text()) for path in tmp_path.glob("pid*")]
    assert [pid for pid in pids if Path(f"/proc/{pid}").exists()] == []
    assert sorted(path.name for path in tmp_path.iterdir()) == ["pid0", "pid1"]


def _stopped_when(reached, function) -> None:
    """Do the work, and be interrupted as by Ctrl-C."""
    import signal
    import threading

    def interrupt() -> None:
        while not reached():
            time.sleep(0.05)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt, daemon=True).start()
    done(function, range(4))
