"""The slowest part of a run's compiled code, compiled by a second process while the first opens the recording.

What is compiled is kept (`evimo.compiling`), so that the first process finds it where it comes to need it. It only
matters for the first run after an installation, which would else take half as long again until its first estimate.
"""

import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager, suppress

import numpy as np

from evimo.compiling import is_kept
from evimo.events.direct_alignment import FEWEST, aligned
from evimo.events.images import blurred
from evimo.events.local_motion import motion_candidates
from evimo.events.stack import SLICES, VOXELS, EventStack, StaticMotion
from evimo.jobs.crew import cores

SIDE, STEP = 64, 4  # px of a made-up image, and of it per pixel of its depth


@contextmanager
def compiled_beside() -> Generator[None]:
    """Have a second process compile while the `with` lasts, if nothing is compiled and there is a core for it."""
    if is_kept(blurred) or cores() < 2:
        yield
        return
    nothing = subprocess.DEVNULL
    command = [sys.executable, "-P", "-m", "evimo.streaming.beside"]
    process = None
    with suppress(OSError):  # where no more processes are allowed, the first compiles all
        process = subprocess.Popen(command, stdin=nothing, stdout=nothing, stderr=nothing)
    try:
        yield
    finally:
        if process is not None:
            process.kill()
            process.wait()


def compile_passes() -> None:
    """Compile what the passes of a network take longest to: local motion and direct alignment, of made-up events."""
    motion_candidates(np.zeros((VOXELS, SIDE, SIDE), np.float32))
    place = np.linspace(0, SIDE - 1, FEWEST, dtype=np.float32)
    time = np.linspace(-SLICES / 2, SLICES / 2, len(place), endpoint=False, dtype=np.float32)
    stack = EventStack(place, place, time, np.ones(len(place), np.bool_))
    inv_depth = np.ones((SIDE // STEP, SIDE // STEP), np.float32)
    intrinsics = np.array((SIDE, SIDE, SIDE / 2, SIDE / 2), np.float32)
    aligned(stack, StaticMotion(np.zeros((SLICES, 6), np.float32), inv_depth, STEP, intrinsics))


if __name__ == "__main__":
    compile_passes()
