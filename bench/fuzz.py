"""Damaged files for every reader of recordings and their truth, calibrations, captures and predictions.

    python bench/fuzz.py [--files 100000] [--seed 0] [--processes 2] [--shared ../shared/data] [--of WORD]
                         [--only INDEX --keep DIR]

File number i of a seed is always the same: a small recording, calibration or prediction, generated or of the folder
`--shared`, whose bytes are changed in one to eight places. It is found to be wrong where reading it ends in anything
but events, a camera, scores or an `EvimoError`, takes over 10 s, takes over 200 MB and twice the file of memory, or
runs what the file says. `--of WORD` takes only those whose names hold that word, such as predictions.
"""

import argparse
import multiprocessing
import shutil
import sys
import tempfile
import time
import traceback
import warnings
from contextlib import suppress
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from pathlib import Path

import fuzz_predictions
import fuzz_truth
import numpy as np
from fuzz_damage import changed, repacked
from fuzz_seeds import RAN, SIZE, Kind, Seed, seeds
from rich.progress import Progress

from evimo.errors import EvimoError
from evimo.formats import open_events
from evimo.geometry.calibration import load_camera

LONGEST_S = 10.0
MOST_BYTES = 200_000_000
MOST_EVENTS = 5_000_000  # of one file: more would be read for long, but not wrongly


def damaged(seed: Seed, rng: np.random.Generator) -> dict[str, bytes]:
    """The files, one of them changed in one to eight places, mostly near its beginning."""
    name = str(rng.choice(sorted(seed.files)))
    content = seed.files[name]
    if name.endswith(".npz") and rng.integers(2):
        return seed.files | {name: repacked(content, rng)}
    return seed.files | {name: changed(content, rng)}


def read(path: Path, *, kind: Kind) -> None:
    """Read all of a file as users would."""
    if kind == "calibration":
        load_camera(path, size=SIZE)
        return
    if kind == "predictions":
        fuzz_predictions.scored(path)
        return
    if kind == "capture":
        fuzz_truth.read_capture(path)
        return
    recording = open_events(path / "events.txt" if (path / "events.txt").exists() else path)
    count = 0
    for packet in recording:
        count += len(packet)
        if count > MOST_EVENTS:
            break
    recording.gyroscope()
    fuzz_truth.read_truth(path)


def fault_of(path: Path, folder: Path, *, kind: Kind) -> str | None:
    """What is wrong with how the file is read; None where nothing is."""
    size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    before = _memory_bytes(reset=True)
    fault = None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            read(path, kind=kind)
        except EvimoError as error:
            if not str(error).strip() or not error.fix:
                fault = "an EvimoError without a fix"
        except Exception:
            fault = traceback.format_exc()
    used = _memory_bytes() - before
    if fault is None and used > MOST_BYTES + 2 * size:
        fault = f"{used / 1e6:.0f} MB of memory for a file of {size / 1e6:.2f} MB"
    if fault is None and (Path(RAN).exists() or (folder / RAN).exists()):
        fault = "it ran what the file says"
    return fault


def _memory_bytes(*, reset: bool = False) -> int:
    """The most memory this process had since the last reset; 0 where the system does not tell."""
    status = Path("/proc/self/status")
    if not status.exists():
        return 0
    if reset:
        with suppress(OSError):
            Path("/proc/self/clear_refs").write_text("5")
    line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
    return 1024 * int(line.split()[1])


def tried(seed_: Seed, folder: Path, rng: np.random.Generator) -> str | None:
    """Damage a recording or calibration inside a folder, which is emptied first, and read it."""
    written(damaged(seed_, rng), folder)
    return fault_of(folder / seed_.opened, folder, kind=seed_.kind)


def written(files: dict[str, bytes], folder: Path) -> None:
    """Write files into a folder, which is emptied first."""
    shutil.rmtree(folder, ignore_errors=True)
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)


def drawn(all_seeds: list[Seed], seed: int, index: int) -> tuple[Seed, np.random.Generator]:
    """Which recording file `index` is made of, and what its damage is drawn from."""
    rng = np.random.default_rng((seed, index))
    return all_seeds[int(rng.integers(len(all_seeds)))], rng


def _work(pipe: Connection, seed: int, shared: Path | None, of: str) -> None:
    """Try the indices that come through the pipe; answer each with its fault or None."""
    all_seeds = seeds(shared, of)
    with tempfile.TemporaryDirectory() as made:
        for each in all_seeds:  # compile everything before anything is timed
            folder = Path(made) / "whole"
            written(each.files, folder)
            fault_of(folder / each.opened, folder, kind=each.kind)
        Path(RAN).unlink(missing_ok=True)
        pipe.send(None)
        while (index := pipe.recv()) is not None:
            seed_, rng = drawn(all_seeds, seed, index)
            pipe.send(tried(seed_, Path(made) / "file", rng))


class Worker:
    """One process that tries files, replaced when it dies or hangs."""

    def __init__(self, seed: int, shared: Path | None, of: str) -> None:
        self._arguments = seed, shared, of
        self._start()

    def _start(self) -> None:
        self.pipe, theirs = multiprocessing.Pipe()
        context = multiprocessing.get_context("spawn")
        self._process: SpawnProcess = context.Process(target=_work, args=(theirs, *self._arguments), daemon=True)
        self._process.start()
        theirs.close()
        self.index: int | None = None
        self.busy, self._since = True, time.monotonic() + 600  # until all is compiled

    def give(self, index: int) -> None:
        """Let it try a file."""
        self.index, self.busy, self._since = index, True, time.monotonic()
        self.pipe.send(index)

    def result(self) -> tuple[int, str] | None:
        """The fault of what it just tried; None where there is none, or it is not done."""
        index = self.index
        try:
            if self.pipe.poll():
                fault = self.pipe.recv()
                self.busy = False
                return None if fault is None or index is None else (index, fault)
            if time.monotonic() - self._since <= LONGEST_S:
                return None
            fault = f"still reading after {LONGEST_S:g} s"
        except (EOFError, ConnectionError):
            self._process.join()
            fault = f"the process died: {self._process.exitcode}"
        self._process.kill()
        self._start()
        return None if index is None else (index, fault)


def run(files: int, *, seed: int, processes: int, shared: Path | None, of: str = "") -> dict[int, str]:
    """Try that many files; their faults by index."""
    faults: dict[int, str] = {}
    workers = [Worker(seed, shared, of) for _ in range(processes)]
    waiting = iter(range(files))
    with Progress(*Progress.get_default_columns(), "{task.fields[rate]}", disable=not sys.stderr.isatty()) as bar:
        task, started, done, left = bar.add_task("fuzz", total=files, rate=""), time.monotonic(), 0, True
        while left or any(worker.busy for worker in workers):
            for worker in workers:
                was = worker.index if worker.busy else None
                if worker.busy and (found := worker.result()):
                    faults[found[0]] = found[1]
                if was is not None and (not worker.busy or worker.index != was):
                    done += 1
                    bar.update(task, completed=done, rate=f"{done / (time.monotonic() - started):.0f} files/s")
                if not worker.busy and left:
                    index = next(waiting, None)
                    left = index is not None
                    if index is not None:
                        worker.give(index)
            time.sleep(0.0002)
    for worker in workers:
        worker.pipe.send(None)
    return faults


def main() -> int:
    """Parse, run, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--files", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--shared", type=Path, default=Path(__file__).parents[2] / "shared" / "data")
    parser.add_argument("--of", default="")
    parser.add_argument("--only", type=int)
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    if options.only is not None:
        seed_, rng = drawn(seeds(options.shared, options.of), options.seed, options.only)
        print(seed_.name, tried(seed_, options.keep or Path(tempfile.mkdtemp()) / "file", rng))
        return 0
    faults = run(options.files, seed=options.seed, processes=options.processes, shared=options.shared, of=options.of)
    all_seeds = seeds(options.shared, options.of)
    for index, fault in sorted(faults.items()):
        print(f"--only {index} ({drawn(all_seeds, options.seed, index)[0].name}): {fault}\n")
    print(f"{options.files:,} files of {len(all_seeds)} kinds: {len(faults)} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
