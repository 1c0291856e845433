"""Many recordings, each from its own seed: resumable, in one process or several."""

import signal
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from multiprocessing import get_context
from pathlib import Path

import numba
import numpy as np

from evimo.errors import BadInput
from evimo.recordings.writer import RecordingWriter
from evimo.scene.draw import SETS
from evimo.simulate.recording import SLICE_S, simulate_recording


@dataclass(frozen=True, kw_only=True)
class DatasetPlan:
    """What to simulate.

    set_number: 1 to 6, or 0 for all sets in turn. minutes: of recording. seed: of the first recording; others follow.
    seconds: of each recording. camera: `random` or `evimo`. size: (height, width) of the sensor, px.
    """

    set_number: int
    minutes: float
    seed: int
    seconds: float = 1.0
    camera: str = "random"
    size: tuple[int, int] = (260, 346)

    def __post_init__(self) -> None:
        if self.set_number not in (0, *SETS):
            raise BadInput(f"no set {self.set_number}", fix="a set from 1 to 6, or all")
        if self.minutes <= 0 or self.seconds < SLICE_S or min(self.size) < 16:
            raise BadInput(
                f"{self.minutes} minutes of recordings of {self.seconds} s, {self.size[1]}x{self.size[0]} px",
                fix="positive minutes, at least 0.025 s, at least 16x16 px",
            )
        if self.seed < 0:
            raise BadInput(f"seed {self.seed}", fix="a seed from 0")

    @property
    def recordings(self) -> int:
        """How many recordings."""
        return max(1, round(self.minutes * 60 / self.seconds))

    def set_of(self, seed: int) -> int:
        """The set of one recording."""
        return self.set_number or list(SETS)[seed % len(SETS)]

    def folder(self, out: Path, seed: int) -> Path:
        """Where one recording goes."""
        return out / f"set{self.set_of(seed)}_{seed:06d}"


def simulate_dataset(plan: DatasetPlan, out: Path, *, workers: int = 1) -> Iterator[Path]:
    """Write the recordings of a plan that do not exist yet, and yield the folder of each when it is complete."""
    seeds = range(plan.seed, plan.seed + plan.recordings)
    for seed in seeds:
        if (folder := plan.folder(out, seed)).exists():
            yield folder
    missing = [seed for seed in seeds if not plan.folder(out, seed).exists()]
    if workers <= 1:
        yield from map(partial(write_recording, plan, out), missing)
        return
    context, prepare = get_context("spawn"), partial(_prepare_worker, workers)
    with ProcessPoolExecutor(workers, mp_context=context, initializer=prepare) as pool:
        jobs = [pool.submit(write_recording, plan, out, seed) for seed in missing]
        try:
            for job in as_completed(jobs):
                yield job.result()
        finally:
            pool.shutdown(cancel_futures=True)


def _prepare_worker(workers: int) -> None:
    """Share the cores; leave Ctrl-C to the parent, which then waits for the recordings that are under way."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    numba.set_num_threads(max(1, numba.get_num_threads() // workers))


def write_recording(plan: DatasetPlan, out: Path, seed: int) -> Path:
    """Simulate one recording into its folder."""
    recording = simulate_recording(
        seed, set_number=plan.set_of(seed), seconds=plan.seconds, camera=plan.camera, size=plan.size
    )
    folder = plan.folder(out, seed)
    facts = {"version": _version(), "camera_kind": plan.camera, **recording.facts()}
    with RecordingWriter(folder, recording.camera, facts=facts) as writer:
        for piece in recording:
            writer.write(piece.events, piece.truth, clutter_bodies=piece.clutter.astype(np.uint8))
    return folder


def _version() -> str:
    try:
        return version("evimo")
    except PackageNotFoundError:
        return "unknown"
