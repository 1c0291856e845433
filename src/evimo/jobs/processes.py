"""Processes of this machine that do jobs for this one: a job whose process dies is done again by another process."""

import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from evimo.errors import EvimoError
from evimo.jobs.lifeline import PATIENCE_S, deaf_children
from evimo.jobs.outcome import Outcome

TRIES = 3  # processes that may die of one job: a recording that needs too much memory would kill them all


def packed(work: Callable[[Any], Any], job: Any) -> bytes:
    """A job for another process, where relative paths mean what they mean here."""
    return pickle.dumps((os.getcwd(), work, job))


class Processes:
    """As many processes as there are threads that call `outcome` at a time; each has `threads` threads for numba.

    held: a hidden folder; the processes end soon after nobody holds it any more.
    """

    def __init__(self, *, threads: int, held: Path | None = None) -> None:
        self._threads, self._held = threads, held
        self._lock = threading.Lock()
        self._idle: list[_Process] = []
        self._all: set[_Process] = set()
        self._closed = False

    def outcome(self, job: bytes) -> Outcome:
        """What came of a job, as `packed` made it; who dies of it is replaced, and warned of."""
        for died in range(TRIES):
            process = self._taken()
            try:
                outcome = process.outcome(job)
            except _Died:
                self._dropped(process)
                continue
            with self._lock:
                self._idle.append(process)
            made_again = ("its process was ended from outside, and it was made again",) if died else ()
            return outcome._replace(warnings=(*made_again, *outcome.warnings))
        problem = f"{TRIES} processes were ended from outside while they worked on it, perhaps for want of memory"
        return Outcome(error=EvimoError(problem, fix="the same command again, with fewer --workers or more memory"))

    @property
    def is_over(self) -> bool:
        """Whether all processes have ended; there may be new ones."""
        with self._lock:
            return all(process.has_ended for process in self._all)

    def close(self) -> None:
        """End all processes; what is under way is broken off and cleaned up."""
        with self._lock:
            self._closed = True
            processes = list(self._all)
        for process in processes:
            process.break_off()
        for process in processes:
            process.join()

    def _taken(self) -> "_Process":
        with self._lock:
            if self._closed:
                raise EvimoError("broken off", fix="the same command again")
            if self._idle:
                return self._idle.pop()
            process = _Process(self._threads, self._held)
            self._all.add(process)
            return process

    def _dropped(self, process: "_Process") -> None:
        with self._lock:
            self._all.discard(process)
        process.join()


class _Died(Exception):
    """A process has ended in the middle of a job."""


class _Process:
    """A process that works for this one."""

    def __init__(self, threads: int, held: Path | None) -> None:
        # -P: not what lies in the folder that the command happens to be called in
        command = [sys.executable, "-P", "-m", "evimo.jobs.process", *([str(held)] if held else [])]
        shared = os.environ | {"NUMBA_NUM_THREADS": str(threads)}
        pipe = subprocess.PIPE
        with deaf_children():
            self._child = subprocess.Popen(command, stdin=pipe, stdout=pipe, env=shared)

    @property
    def has_ended(self) -> bool:
        return self._child.poll() is not None

    def outcome(self, job: bytes) -> Outcome:
        """What came of a job.

        Raises:
            _Died: the process was ended in the middle of it.
        """
        line, outcomes = self._child.stdin, self._child.stdout
        assert line is not None and outcomes is not None
        try:
            pickle.dump(job, line)
            line.flush()
            return pickle.loads(pickle.load(outcomes))
        except (EOFError, OSError, ValueError, pickle.UnpicklingError) as error:  # ValueError: the line is closed
            raise _Died from error

    def break_off(self) -> None:
        """Close the line that the process hangs on."""
        assert self._child.stdin is not None
        with suppress(OSError):
            self._child.stdin.close()

    def join(self) -> None:
        """Wait until the process has ended; one that does not end is killed."""
        self.break_off()
        try:
            self._child.wait(PATIENCE_S + 10)
        except subprocess.TimeoutExpired:
            self._child.kill()
            self._child.wait()
        assert self._child.stdout is not None
        self._child.stdout.close()
