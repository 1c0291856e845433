"""Jobs for the tests of this folder, in a module that their processes can import."""

import os
import signal
import time
import warnings
from pathlib import Path

from evimo.errors import BadFile, BadInput, EvimoWarning
from evimo.jobs.crew import cores
from evimo.writing import new_folder, save_text


def squared(number: int) -> int:
    print("a job may print")
    return number**2


def where(folder: Path, job: int) -> tuple[int, str, int]:
    """The process, its folder and its cores."""
    return os.getpid(), str(folder.resolve()), cores()


def dies_once(folder: Path, job: int) -> int:
    """The first process that does job 1 is killed in the middle of it."""
    died = folder / "died"
    with new_folder(folder / str(job)):
        if job == 1 and not died.exists():
            died.touch()
            os.kill(os.getpid(), signal.SIGKILL)
    return job


def dies(job: int) -> int:
    if job == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return job


class Unpackable(Exception):
    def __init__(self, *, needed: int) -> None:
        super().__init__(needed)


def fails(job: str) -> str:
    match job:
        case "broken.raw" | "cut.raw":
            raise BadFile(f"{job} ends early", fix="copy it again")
        case "broken":
            raise BadFile("the file ends early", fix="copy it again")
        case "disk":
            raise BadInput("the disk is full", fix="another one")
        case "bug":
            raise ZeroDivisionError("ours")
        case "odd bug":
            raise Unpackable(needed=1)
        case "guess":
            warnings.warn("the camera is guessed", EvimoWarning, stacklevel=1)
    return job


def endless(folder: Path, job: int) -> None:
    """Say who it is, and work for minutes on something that is not to stay."""
    with new_folder(folder / str(job)) as made:
        save_text(str(os.getpid()), folder / f"pid{job}")
        (made / "half").touch()
        for _ in range(3000):
            time.sleep(0.1)
