"""Damaged files for every reader of recordings and every parser of calibrations.

    python bench/fuzz.py [--files 100000] [--seed 0] [--processes 2] [--shared ../shared/data] [--only INDEX --keep DIR]

File number i of a seed is always the same: a small recording or calibration, generated or of the folder `--shared`,
whose bytes are changed in one to eight places. It is found to be wrong where reading it ends in anything but events or
an `EvimoError`, takes over 10 s, takes over 200 MB and twice the file of memory, or runs what the file says.
"""

import argparse
import json
import multiprocessing
import pickle
import shutil
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress

from evimo.errors import EvimoError
from evimo.events.events import Events
from evimo.formats import open_events
from evimo.formats.saving import SAVE, save_events
from evimo.geometry.calibration import load_camera
from evimo.recordings.layouts import knows_truth
from evimo.recordings.recording import open_recording

SIZE = (48, 64)
LONGEST_S = 10.0
MOST_BYTES = 200_000_000
MOST_EVENTS = 5_000_000  # of one file: more would be read for long, but not wrongly
HEAD = 1 << 16  # bytes of a real recording
NUMBERS = (b"nan", b"inf", b"-1", b"1e400", b"99999999999999999999", b"0x7f", b"1_0", b"\xc2\xb2", b"", b"True")
RAN = "ran_what_the_file_says"


@dataclass(frozen=True)
class Seed:
    """A whole recording or calibration: its files by name, and which of them is opened ("" is the folder)."""

    name: str
    files: dict[str, bytes]
    opened: str
    calibration: bool = False


def some_events(count: int = 2000) -> Events:
    """Sorted events of a small sensor."""
    rng = np.random.default_rng(0)
    x, y = (rng.integers(0, side, count).astype(np.uint16) for side in SIZE[::-1])
    return Events(x, y, np.sort(rng.integers(0, 200_000, count)), rng.choice(np.array((-1, 1), np.int8), count))


class Payload:
    """An object whose pickle makes a file when it is loaded."""

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (Path(RAN),)


def text_seeds(events: Events) -> Iterator[Seed]:
    """Text in several layouts."""
    columns = {"t": events.t, "x": events.x, "y": events.y, "p": events.p > 0}
    layouts = {
        "txyp": ("", " "),
        "xytp": ("x,y,t,p\n", ","),
        "xypt": ("%geometry:64,48\n", ","),
        "ptxy": ("p;t;x;y\n", ";"),
    }
    for order, (head, between) in layouts.items():
        rows = np.stack([columns[name] for name in order], axis=1)[:300].tolist()
        lines = head + "".join(between.join(map(str, row)) + "\n" for row in rows)
        yield Seed(f"text {order}", {"a.txt": lines.encode()}, "a.txt")
    seconds = "".join(f"{t / 1e6:.6f} {x} {y} {p}\n" for t, x, y, p in rows)
    yield Seed("text in seconds", {"a.csv": seconds.encode()}, "a.csv")
    yield Seed("UTF-16", {"a.csv": lines.encode("utf-16")}, "a.csv")


def archive_seeds(events: Events, folder: Path) -> Iterator[Seed]:
    """NumPy archives and folders, one of them with a pickle that would run."""
    rows = np.stack((events.t * 1e-6, events.x, events.y, events.p > 0), axis=1)
    matrix = np.array([[50.0, 0, 31], [0, 51, 23], [0, 0, 1]])
    depth = np.ones((2, *SIZE), np.float32)
    np.savez(folder / "a.npz", events=rows, K=matrix, D=np.zeros(4), depth=depth, meta=np.array(Payload(), object))
    np.savez_compressed(folder / "b.npz", events=rows, depth=depth)
    for name in ("a.npz", "b.npz"):
        yield Seed(f"EV-IMO {name}", {name: (folder / name).read_bytes()}, name)
    plain = folder / "evimo2"
    plain.mkdir()
    np.save(plain / "dataset_events_t.npy", events.t * 1e-6)
    np.save(plain / "dataset_events_xy.npy", np.stack((events.x, events.y), axis=1))
    np.save(plain / "dataset_events_p.npy", (events.p > 0).astype(np.uint8))
    np.savez(plain / "dataset_depth.npz", depth_0=depth[0])
    np.savez(plain / "dataset_info.npz", K=matrix, meta=np.array(Payload(), object))
    (plain / "dataset_info.json").write_text(
        json.dumps({"meta": {"fx": 50, "fy": 51, "cx": 31, "cy": 23, "res_x": 64, "res_y": 48}})
    )
    yield Seed("EVIMO2", {path.name: path.read_bytes() for path in plain.iterdir()}, "")
    yield Seed("a pickle", {"a.npy": pickle.dumps(Payload())}, "a.npy")


def binary_seeds(events: Events, folder: Path) -> Iterator[Seed]:
    """What we write ourselves."""
    for name in SAVE:
        path = folder / f"a.{name}"
        save_events([events], path, size=SIZE)
        yield Seed(f"written {name}", {path.name: path.read_bytes()}, path.name)


def calibration_seeds() -> Iterator[Seed]:
    """Calibrations in text, one of them with YAML that would run."""
    kalibr = "cam0:\n  camera_model: pinhole\n  intrinsics: [50, 51, 31, 23]\n  distortion_model: radtan\n"
    kalibr += "  distortion_coeffs: [-0.1, 0.01, 0, 0]\n  resolution: [64, 48]\n  rostopic: /events\n"
    ros = "image_width: 64\nimage_height: 48\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [50,0,31,0,51,23,0,0,1]\n"
    ros += "distortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0.1, 0, 0, 0, 0]\n"
    yield Seed("kalibr", {"a.yaml": kalibr.encode()}, "a.yaml", calibration=True)
    yield Seed("camera_info", {"a.yaml": ros.encode()}, "a.yaml", calibration=True)
    runs = f"cam0: !!python/object/apply:os.mkdir [{RAN}]\n{kalibr}"
    yield Seed("YAML that runs", {"a.yaml": runs.encode()}, "a.yaml", calibration=True)
    yield Seed("nine numbers", {"calib.txt": b"50 51 31 23 -0.1 0.01 0 0 0"}, "calib.txt", calibration=True)


def shared_seeds(shared: Path) -> Iterator[Seed]:
    """Heads of real recordings, and real calibrations."""
    recordings = shared / "formats"
    for path in sorted(path for path in recordings.rglob("*") if path.is_file() and path.suffix not in (".csv", "")):
        folder = path.parent
        if (folder / "metadata.yaml").exists():
            if path.name == "metadata.yaml":
                files = {each.name: each.read_bytes() for each in sorted(folder.iterdir())}
                yield Seed(f"shared {folder.name}", files, "")
            continue
        content = path.read_bytes()
        whole = len(content) <= 4 * HEAD or path.suffix == ".h5"
        yield Seed(f"shared {path.name}", {path.name: content if whole else content[:HEAD]}, path.name)
    kinds = {".yaml", ".yml", ".txt", ".json", ".xml"}
    for path in sorted(path for path in (shared / "calibration").rglob("*") if path.suffix in kinds):
        if path.stat().st_size <= HEAD:
            name = f"calibration {path.relative_to(shared)}"
            yield Seed(name, {path.name: path.read_bytes()}, path.name, calibration=True)


def seeds(shared: Path | None) -> list[Seed]:
    """Everything that is damaged here."""
    events = some_events()
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        found = [*text_seeds(events), *archive_seeds(events, folder), *binary_seeds(events, folder)]
    found += calibration_seeds()
    return found + (list(shared_seeds(shared)) if shared and shared.exists() else [])


def bit_flipped(data: bytearray, rng: np.random.Generator) -> None:
    """One bit."""
    data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))


def byte_set(data: bytearray, rng: np.random.Generator) -> None:
    """One byte, to anything or to an end of its range."""
    data[rng.integers(len(data))] = int(rng.choice([0, 255, 127, 128, 10, 32, int(rng.integers(256))]))


def word_set(data: bytearray, rng: np.random.Generator) -> None:
    """Four or eight bytes, to what lengths and offsets should never be."""
    width = int(rng.choice([4, 8]))
    at = int(rng.integers(max(1, len(data) - width + 1)))
    value = int(rng.choice([0, 1, 2 ** (8 * width - 1) - 1, 2**31 - 1, 2**32 - 1, 2**20], shuffle=False)) % 2 ** (
        8 * width
    )
    data[at : at + width] = value.to_bytes(width, str(rng.choice(["little", "big"])))[: len(data) - at]  # type: ignore[arg-type]


def cut(data: bytearray, rng: np.random.Generator) -> None:
    """Everything behind some place."""
    del data[int(rng.integers(len(data))) :]


def removed(data: bytearray, rng: np.random.Generator) -> None:
    """A stretch of bytes."""
    at = int(rng.integers(len(data)))
    del data[at : at + int(rng.integers(1, 65))]


def repeated(data: bytearray, rng: np.random.Generator) -> None:
    """A stretch, once more at another place."""
    at, to = (int(rng.integers(len(data))) for _ in range(2))
    data[to:to] = data[at : at + int(rng.integers(1, 4097))]


def noise(data: bytearray, rng: np.random.Generator) -> None:
    """A stretch, overwritten by anything."""
    at = int(rng.integers(len(data)))
    length = min(int(rng.integers(1, 257)), len(data) - at)
    data[at : at + length] = rng.bytes(length)


def word_replaced(data: bytearray, rng: np.random.Generator) -> None:
    """What stands between two separators of a text, by a number that is none or too large."""
    at = int(rng.integers(len(data)))
    ends = [place for mark in b" ,;:\n[]" if (place := data.find(mark, at)) >= 0]
    data[at : min(ends, default=len(data))] = NUMBERS[int(rng.integers(len(NUMBERS)))]


MUTATIONS: tuple[Callable[[bytearray, np.random.Generator], None], ...] = (
    bit_flipped,
    byte_set,
    word_set,
    cut,
    removed,
    repeated,
    noise,
    word_replaced,
)


def damaged(seed: Seed, rng: np.random.Generator) -> dict[str, bytes]:
    """The files, one of them changed in one to eight places, mostly near its beginning."""
    name = str(rng.choice(sorted(seed.files)))
    data = bytearray(seed.files[name])
    for _ in range(int(rng.integers(1, 9))):
        if not data:
            break
        front = int(min(len(data), rng.choice([64, 1024, len(data)])))
        part = data[:front]
        MUTATIONS[int(rng.integers(len(MUTATIONS)))](part, rng)
        data[:front] = part
    return seed.files | {name: bytes(data)}


def read(path: Path, *, calibration: bool) -> None:
    """Read all of a file as users would."""
    if calibration:
        load_camera(path, size=SIZE)
        return
    recording = open_events(path)
    count = 0
    for packet in recording:
        count += len(packet)
        if count > MOST_EVENTS:
            break
    recording.gyroscope()
    if knows_truth(path):
        open_recording(path).truth(0)


def fault_of(path: Path, folder: Path, *, calibration: bool) -> str | None:
    """What is wrong with how the file is read; None where nothing is."""
    size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    before = _memory_bytes(reset=True)
    fault = None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            read(path, calibration=calibration)
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
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name, content in damaged(seed_, rng).items():
        (folder / name).write_bytes(content)
    return fault_of(folder / seed_.opened, folder, calibration=seed_.calibration)


def drawn(all_seeds: list[Seed], seed: int, index: int) -> tuple[Seed, np.random.Generator]:
    """Which recording file `index` is made of, and what its damage is drawn from."""
    rng = np.random.default_rng((seed, index))
    return all_seeds[int(rng.integers(len(all_seeds)))], rng


def _work(pipe: Connection, seed: int, shared: Path | None) -> None:
    """Try the indices that come through the pipe; answer each with its fault or None."""
    all_seeds = seeds(shared)
    with tempfile.TemporaryDirectory() as made:
        for each in all_seeds:  # compile everything before anything is timed
            folder = Path(made) / "whole"
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            for name, content in each.files.items():
                (folder / name).write_bytes(content)
            fault_of(folder / each.opened, folder, calibration=each.calibration)
        Path(RAN).unlink(missing_ok=True)
        pipe.send(None)
        while (index := pipe.recv()) is not None:
            seed_, rng = drawn(all_seeds, seed, index)
            pipe.send(tried(seed_, Path(made) / "file", rng))


class Worker:
    """One process that tries files, replaced when it dies or hangs."""

    def __init__(self, seed: int, shared: Path | None) -> None:
        self._arguments = seed, shared
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


def run(files: int, *, seed: int, processes: int, shared: Path | None) -> dict[int, str]:
    """Try that many files; their faults by index."""
    faults: dict[int, str] = {}
    workers = [Worker(seed, shared) for _ in range(processes)]
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
    parser.add_argument("--only", type=int)
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    if options.only is not None:
        seed_, rng = drawn(seeds(options.shared), options.seed, options.only)
        print(seed_.name, tried(seed_, options.keep or Path(tempfile.mkdtemp()) / "file", rng))
        return 0
    faults = run(options.files, seed=options.seed, processes=options.processes, shared=options.shared)
    all_seeds = seeds(options.shared)
    for index, fault in sorted(faults.items()):
        print(f"--only {index} ({drawn(all_seeds, options.seed, index)[0].name}): {fault}\n")
    print(f"{options.files:,} files of {len(all_seeds)} kinds: {len(faults)} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
