"""Recordings made on a Dask cluster of two processes, which are killed, lose their command, or are not fit for it."""

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from functools import partial
from pathlib import Path

import pytest
from tests.captures.desk import save_desk
from tests.recordings.dataset_files import v1_npz

from evimo.cli import main
from evimo.errors import BadInput, EvimoError, NotFound
from evimo.jobs import cluster as on_cluster
from evimo.jobs.crew import Crew
from evimo.jobs.finishing import finished

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="kills"),
    pytest.mark.filterwarnings("ignore:.*has no workers yet"),  # they start with the first test
]


def within_s(seconds: float, reached) -> bool:
    """Whether something becomes true in time."""
    deadline = time.monotonic() + seconds
    while not (now := reached()) and time.monotonic() < deadline:
        time.sleep(0.05)
    return bool(now)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in sorted(folder.rglob("*")) if file.is_file()}


def test_errors_come_back_with_the_name_of_the_recording(cluster, tmp_path):
    import made_up_work

    crew = Crew(dask=cluster.scheduler)
    results = finished(made_up_work.fails, ["a", "broken.raw", "b"], crew=crew, shared=tmp_path, name=str)
    assert sorted((next(results), next(results))) == ["a", "b"]
    with pytest.raises(EvimoError, match=r"broken.raw ends early \(on .*\)\n  try: copy it again"):
        next(results)
    with pytest.raises(ZeroDivisionError, match="ours"):
        list(finished(made_up_work.fails, ["bug"], crew=crew, shared=tmp_path, name=str))
    assert list(tmp_path.iterdir()) == []


def test_a_worker_with_another_evimo_is_refused(cluster, tmp_path, monkeypatch):
    import made_up_work

    monkeypatch.setattr(on_cluster, "_release", lambda: "evimo of yesterday")
    with pytest.raises(EvimoError, match=r"(?s)the Dask worker on .* has evimo .*, and the command evimo of yesterday"):
        list(finished(made_up_work.squared, [1], crew=Crew(dask=cluster.scheduler), shared=tmp_path, name=str))


def test_a_worker_that_does_not_see_the_folder_or_its_locks_says_so(tmp_path):
    release, hidden = on_cluster._release(), tmp_path / ".unfinished-x"
    error = on_cluster._outcome_here(b"", release, hidden).error
    assert isinstance(error, EvimoError) and f"does not see what is written to {tmp_path}" in error.problem
    hidden.mkdir()
    error = on_cluster._outcome_here(b"", release, hidden).error
    assert isinstance(error, EvimoError) and "are not locked for the Dask worker" in error.problem


def test_what_is_no_scheduler_is_one_clear_error(tmp_path, monkeypatch, capsys):
    pytest.importorskip("distributed", reason="needs evimo[cluster]")
    monkeypatch.setattr(on_cluster, "CONNECTING_S", 0.5)
    (tmp_path / "no.json").write_text("{}")
    for scheduler, error, words in (
        ("tcp://127.0.0.1:1", NotFound, "no Dask scheduler at tcp://127.0.0.1:1"),
        ("carrier pigeon", BadInput, "'carrier pigeon' is no address"),
        ("foo://x:1", BadInput, "is no address"),
        (str(tmp_path / "no.json"), BadInput, "is no address of a Dask scheduler"),
    ):
        with pytest.raises(error, match=words):
            list(finished(len, ["a"], crew=Crew(dask=scheduler), shared=tmp_path, name=str))
    assert main(["simulate", "--minutes", "1", "--dask", "a", "--workers", "2", "--out", str(tmp_path)]) == 2
    assert "one of the two" in capsys.readouterr().err


@pytest.mark.parametrize("how", ["TERM", "KILL"])
def test_the_cluster_drops_the_work_of_a_command_that_ends(how, cluster, tmp_path):
    program = (
        "from evimo.cli.boundary import outcome; import sys; from functools import partial; from pathlib import Path\n"
        "import made_up_work; from evimo.jobs.crew import Crew; from evimo.jobs.finishing import finished\n"
        "out = Path(sys.argv[2]); work = partial(made_up_work.endless, out)\n"
        "sys.exit(outcome(lambda: list(finished(work, range(9), crew=Crew(dask=sys.argv[1]), shared=out, name=str))))"
    )
    command = subprocess.Popen([sys.executable, "-c", program, cluster.scheduler, str(tmp_path)])
    assert within_s(20, lambda: len(list(tmp_path.glob("pid*"))) == 2)
    command.send_signal(getattr(signal, f"SIG{how}"))
    assert command.wait(20) == (143 if how == "TERM" else -9)
    pids = [int(path.read_text()) for path in tmp_path.glob("pid*")]
    assert within_s(20, lambda: not any(Path(f"/proc/{pid}").exists() for pid in pids))
    left = {path.name for path in tmp_path.iterdir()} - {"pid0", "pid1"}
    assert len(left) == (how == "KILL")  # the folder by which it lived; the next one that writes there removes it


def on_disk(command: str, folder: Path) -> list[str]:
    """Two recordings, or captures, for a command, and how it is asked for its quickest work."""
    if command == "annotate":
        captures = [save_desk(folder / name, points=2000) for name in ("desk", "table")]
        return [command, *map(str, captures), "--rate", "20"]
    if command == "convert":
        return [command, *(str(v1_npz(folder / f"seq_0{k}.npz")) for k in range(2)), "--layout", "hdf5"]
    rows = "\n".join(f"{30 * k} {k % 32} {k % 24} {k % 2}" for k in range(5000))
    for name in ("one", "other"):
        (folder / f"{name}.txt").write_text(rows)
    texts = [str(folder / f"{name}.txt") for name in ("one", "other")]
    return [command, *texts, "--model", "classical", "--sensor", "32x24", "--no-video", "--no-dense"]


@pytest.mark.parametrize("command", ["annotate", "convert", "run"])
def test_the_cluster_makes_what_one_process_makes(command, cluster, tmp_path, capsys):
    (tmp_path / "in").mkdir()
    asked, together = on_disk(command, tmp_path / "in"), tmp_path / "together"
    assert main([*asked, "--out", str(tmp_path / "alone")]) == 0
    assert main([*asked, "--out", str(together), "--dask", cluster.scheduler]) == 0
    made, alone = contents(together), contents(tmp_path / "alone")
    for name in [name for name in alone if name.endswith("summary.json")]:  # which says when, how fast and where
        assert json.loads(made.pop(name))["slices"] == json.loads(alone.pop(name))["slices"]
    assert made == alone and len(made) >= 2 and len(list(together.iterdir())) == 2
    capsys.readouterr()
    assert main([*asked, "--out", str(together), "--dask", cluster.scheduler]) == 0
    assert re.search(r"\b0 of (them|2)", capsys.readouterr().out)
    assert contents(together).items() >= made.items()


def test_a_worker_that_is_killed_costs_nothing(cluster, tmp_path):
    """One worker is left for the next test, the last one."""
    asked = ["simulate", "--minutes", "0.01", "--seconds", "0.05", "--size", "44x33", "--out"]
    assert main([*asked, str(tmp_path / "alone")]) == 0
    together, (victim, other) = tmp_path / "together", cluster.workers

    def kill() -> None:
        busy = f"/proc/{victim.pid}/task"
        at_work = partial(_children, busy)
        if within_s(60, lambda: any(together.glob("set*")) and at_work()):
            victim.kill()

    thread = threading.Thread(target=kill)
    thread.start()
    assert main([*asked, str(together), "--dask", cluster.scheduler]) == 0
    thread.join()
    assert victim.wait(5) == -9 and other.poll() is None
    assert contents(together) == contents(tmp_path / "alone")
    assert len(list(together.iterdir())) == 12


def test_a_scheduler_that_goes_is_one_clear_error(cluster, tmp_path):
    import made_up_work

    def kill() -> None:
        if within_s(20, lambda: any(tmp_path.glob("pid*"))):
            cluster.leader.kill()

    thread = threading.Thread(target=kill)
    thread.start()
    work, crew = partial(made_up_work.endless, tmp_path), Crew(dask=cluster.scheduler)
    with pytest.raises(EvimoError, match=r"^the Dask scheduler has gone\n  try: the same command again"):
        list(finished(work, range(3), crew=crew, shared=tmp_path, name=str))
    thread.join()
    assert within_s(20, lambda: {path.name for path in tmp_path.iterdir()} <= {"pid0", "pid1", "pid2"})


def _children(tasks: str) -> bool:
    return any((Path(tasks) / task / "children").read_text() for task in os.listdir(tasks))
