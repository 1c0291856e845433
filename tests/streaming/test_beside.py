"""What a second process compiles is what a run needs, and it ends with the run."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from evimo.samples import path as sample
from evimo.streaming import beside

TOLD = """
import sys
from numba.core import event

class Told(event.Listener):
    def on_start(self, event):
        print(event.data["dispatcher"].py_func.__module__, file=sys.stderr)
    def on_end(self, event):
        pass

event.register("numba:compile", Told())
from evimo.streaming import pipeline
next(pipeline.run(sys.argv[1]))
"""
BESIDE = {f"evimo.events.{name}" for name in ("images", "local_motion", "direct_alignment")}


def compiled_by(*words: str, cache: Path) -> set[str]:
    """The modules with functions that a process of Python compiled, if it tells them."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache)}
    done = subprocess.run([sys.executable, *words], env=environment, stderr=subprocess.PIPE, text=True, check=True)
    return set(done.stderr.split())


def test_a_run_finds_what_was_compiled_beside_it(tmp_path):
    compiled_by("-m", "evimo.streaming.beside", cache=tmp_path)
    compiled = compiled_by("-c", TOLD, str(sample()), cache=tmp_path)
    assert "evimo.events.stack" in compiled
    assert not compiled & BESIDE


@pytest.mark.parametrize(("kept", "cores"), [(True, 4), (False, 1)])
def test_nothing_starts_where_it_would_not_help(monkeypatch, kept, cores):
    monkeypatch.setattr(beside, "is_kept", lambda _: kept)
    monkeypatch.setattr(beside, "cores", lambda: cores)
    monkeypatch.setattr(subprocess, "Popen", lambda *_, **__: pytest.fail("a process was started"))
    with beside.compiled_beside():
        pass


def test_the_second_process_ends_with_the_first(monkeypatch):
    processes, popen = [], subprocess.Popen
    monkeypatch.setattr(beside, "is_kept", lambda _: False)
    monkeypatch.setattr(beside, "cores", lambda: 2)
    monkeypatch.setattr(
        subprocess, "Popen", lambda *words, **how: processes.append(popen(*words, **how)) or processes[0]
    )
    with pytest.raises(KeyboardInterrupt), beside.compiled_beside():
        assert processes[0].poll() is None
        raise KeyboardInterrupt
    assert processes[0].poll() is not None


def test_a_run_goes_on_where_no_second_process_may_start(monkeypatch):
    def refuse(*_, **__):
        raise BlockingIOError("no more processes")

    monkeypatch.setattr(beside, "is_kept", lambda _: False)
    monkeypatch.setattr(beside, "cores", lambda: 2)
    monkeypatch.setattr(subprocess, "Popen", refuse)
    with beside.compiled_beside():
        pass


def test_programs_in_the_folder_of_a_run_are_not_started(monkeypatch, tmp_path):
    (tmp_path / "numpy.py").write_text("open('started', 'w')\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(beside, "is_kept", lambda _: False)
    monkeypatch.setattr(beside, "cores", lambda: 2)
    commands, popen = [], subprocess.Popen
    monkeypatch.setattr(subprocess, "Popen", lambda words, **how: commands.append(words) or popen([*words[:1], "-V"]))
    with beside.compiled_beside():
        pass
    monkeypatch.undo()
    subprocess.run([*commands[0][:-1], "evimo.events.events"], cwd=tmp_path, check=True)  # which imports NumPy, too
    assert not (tmp_path / "started").exists()
