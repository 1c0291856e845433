"""What a process that works for another one does: `python -m evimo.jobs.process [FOLDER]`.

Jobs come on its standard input, outcomes go to its standard output; its parent is `evimo.jobs.processes`. It ends when
its input does, and also when nobody holds the hidden FOLDER any more, by which the command lives on another machine.
Both pipes are between two processes of ours, as those of `multiprocessing` are: no file is ever unpickled here.
"""

import os
import pickle
import sys
import time
from contextlib import suppress
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import Any, BinaryIO, NoReturn

from evimo.jobs.lifeline import at_work, end_after, hang_on
from evimo.jobs.outcome import Outcome, as_bytes, outcome_of
from evimo.writing import is_held

LOOKS_EVERY_S = 2.0  # whether the command still lives


def main(arguments: list[str]) -> NoReturn:
    """Do jobs until nobody wants them any more."""
    packed: SimpleQueue[bytes] = SimpleQueue()
    hang_on(partial(_receive, sys.stdin.buffer, packed))
    for folder in arguments:
        end_after(partial(_watch, Path(folder)))
    outcomes = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a job prints must not get between outcomes
    while True:
        job = packed.get()
        with at_work():
            outcome = as_bytes(_done(job))
        pickle.dump(outcome, outcomes)
        outcomes.flush()


def _done(packed: bytes) -> Outcome:
    folder, work, job = pickle.loads(packed)
    with suppress(OSError):  # on another machine it may not exist, and matters to relative paths alone
        os.chdir(folder)
    return outcome_of(work, job)


def _receive(line: BinaryIO, packed: "SimpleQueue[Any]") -> None:
    """Take jobs until the line ends."""
    with suppress(EOFError, OSError, pickle.UnpicklingError):  # the last: in the middle of a job
        while True:
            packed.put(pickle.load(line))


def _watch(folder: Path) -> None:
    """Return when nobody holds the folder any more."""
    while is_held(folder):
        time.sleep(LOOKS_EVERY_S)


if __name__ == "__main__":
    main(sys.argv[1:])
