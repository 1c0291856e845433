"""Every command on machines as they are: full and read-only disks, closed outputs, signals."""

import importlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import pytest

from evimo.simulate.dataset import DatasetPlan, simulate_dataset
from evimo.simulate.plan import RecordingPlan

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform != "linux", reason="made of Linux's own means")]
WRITING = ("run", "view", "simulate", "train", "evaluate", "realism", "benchmark")
COMMANDS = (*WRITING, "info")
KEEPING = ("train", "benchmark")  # what is finished, so that the next one goes on from there


@dataclass(frozen=True)
class Inputs:
    """Files that commands read."""

    recording: Path
    simulated: Path
    network: Path

    def arguments(self, command: str, out: Path) -> list[str]:
        """Of the command, as short a work as there is, which writes below `out`."""
        ours, film, model = map(str, (self.recording, self.simulated, self.network))
        each = {
            "run": [ours, "--model", model, "--out", str(out)],
            "view": [ours, "--save", str(out / "film.mp4")],
            "simulate": ["--minutes", "0.005", "--seconds", "0.1", "--size", "64x48", "--set", "1", "--out", str(out)],
            "train": [film, "--preset", "tiny", "--steps", "2", "--batch", "1", "--out", str(out)],
            "evaluate": [film, "--model", model, "--out", str(out)],
            "realism": [ours, "--simulated", film, "--out", str(out)],
            "benchmark": ["--data", film, "--models", model, "--out", str(out)],
            "info": [ours],
        }
        return [command, *each[command]]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory, fake_network: Path) -> Inputs:
    folder = tmp_path_factory.mktemp("inputs")
    import numpy as np

    rng = np.random.default_rng(0)
    rows = np.stack([np.sort(rng.integers(0, 300_000, 3000)), *rng.integers(0, (32, 24, 2), (3000, 3)).T], axis=1)
    np.savetxt(folder / "noise.txt", rows, fmt="%d")
    plan = DatasetPlan(first=RecordingPlan(seed=3, set_number=1, seconds=0.2, size=(48, 64)), minutes=0.2 / 60)
    list(simulate_dataset(plan, folder / "simulated"))
    return Inputs(folder / "noise.txt", folder / "simulated", fake_network)


def started(arguments: list[str], **how) -> subprocess.Popen[str]:
    how = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True} | how
    return subprocess.Popen([sys.executable, "-m", "evimo", *arguments], **how)


def ended(arguments: list[str], **how) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of a command."""
    process = started(arguments, **how)
    out, err = process.communicate(timeout=300)
    return process.returncode, out or "", err or ""


def told_in_two_lines(err: str) -> bool:
    """An error and its fix, after what was said of progress and the like."""
    *_, error, fix = err.splitlines()
    return error.startswith("error: ") and fix.startswith("  try: ") and "Traceback" not in err


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Callable[[str], Path]]:
    """Mounts a small disk with those options; skips where that is not permitted."""
    place = tmp_path / "disk"
    place.mkdir()

    def mounted(options: str) -> Path:
        done = subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(place)], capture_output=True)
        if done.returncode:
            pytest.skip(f"needs to mount a small disk: {done.stderr.decode().strip()}")
        return place

    yield mounted
    subprocess.run(["umount", str(place)], capture_output=True)


@pytest.mark.parametrize("command, room_k", [*((command, 16) for command in WRITING), ("run", 0), ("run", 60)])
def test_a_full_disk_is_two_lines_and_nothing_half_written(command, room_k, inputs, disk):
    place = disk("size=200k")
    (place / "fill").write_bytes(bytes((200 - room_k) * 1024 - 4096))
    code, _, err = ended(inputs.arguments(command, place / "out"))
    assert code == 2, err
    assert told_in_two_lines(err), err
    assert str(place) in err
    left = [path for path in place.rglob("*") if path.is_file() and path.name != "fill"]
    assert [path for path in left if command not in KEEPING or path.name.startswith(".")] == []


@pytest.mark.parametrize("command", WRITING)
def test_a_read_only_disk_is_two_lines(command, inputs, disk):
    place = disk("ro")
    code, _, err = ended(inputs.arguments(command, place / "out"))
    assert (code, told_in_two_lines(err)) == (2, True), err
    assert "Read-only file system" in err


@pytest.mark.parametrize("command", COMMANDS)
def test_an_output_that_nobody_reads_is_no_news(command, inputs, tmp_path):
    read, write = os.pipe()
    os.close(read)
    code, _, err = ended(inputs.arguments(command, tmp_path / "out"), stdout=write)
    os.close(write)
    assert code == 2, err
    assert "Traceback" not in err and "error" not in err


@pytest.mark.parametrize("command", COMMANDS)
def test_an_output_without_room_is_two_lines(command, inputs, tmp_path):
    with open("/dev/full", "w") as full:
        code, _, err = ended(inputs.arguments(command, tmp_path / "out"), stdout=full)
    assert (code, told_in_two_lines(err)) == (2, True), err
    assert "No space left" in err


@pytest.fixture(scope="module")
def machines() -> ModuleType:
    """The script that makes the table of docs/machines.md."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).parents[2] / "bench"))
        return importlib.import_module("machines")


@pytest.fixture(scope="module")
def long_inputs(machines, tmp_path_factory, fake_network):
    return machines.made_inputs(tmp_path_factory.mktemp("long"), model=str(fake_network))


@pytest.mark.parametrize(
    "command, number",
    [
        *((each, signal.SIGTERM) for each in (*COMMANDS, "evaluate --truth")),
        *(("simulate", each) for each in (signal.SIGHUP, signal.SIGINT)),
    ],
)
def test_signals_end_every_command(command, number, machines, long_inputs, tmp_path):
    """As soon as it works, however fast the machine is: it is halted there until the signal has come."""
    arguments = long_inputs.arguments(command, tmp_path / "out", long=True)
    works = machines.at_work(command, long_inputs, tmp_path / "out")
    code, err = machines.signalled(arguments, number, works=works)
    assert code == 128 + number, err
    assert "Traceback" not in err
    assert machines.hidden_in(tmp_path) == []


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_processes_that_simulate_end_with_the_first_one(how, inputs, tmp_path):
    plan = ["--minutes", "5", "--set", "1", "--size", "64x48", "--workers", "2"]
    arguments = ["simulate", *plan, "--out", str(tmp_path)]
    process = started(arguments, start_new_session=True)
    deadline = time.monotonic() + 100
    while not any(tmp_path.glob("set*")) and time.monotonic() < deadline:
        time.sleep(0.2)
    others = [pid for pid in in_group(process.pid) if pid != process.pid]
    assert len(others) >= 2
    process.send_signal(how)
    process.communicate(timeout=60)
    assert process.returncode == (143 if how == signal.SIGTERM else -9)
    while in_group(process.pid) and time.monotonic() < deadline:
        time.sleep(0.2)
    assert in_group(process.pid) == []
    assert list(tmp_path.glob(".*")) == [] or how == signal.SIGKILL


def in_group(leader: int) -> list[int]:
    """The processes of a process group that still work."""
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = status.read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue
        if int(fields[2]) == leader and fields[0] != "Z":
            found.append(int(status.parent.name))
    return found


@pytest.mark.parametrize("device", ["cuda", "gpu0"])
@pytest.mark.parametrize("command", ["train", "simulate"])
def test_a_device_that_is_not_there_is_two_lines(command, device, inputs, tmp_path):
    blind = os.environ | {"CUDA_VISIBLE_DEVICES": ""}
    code, _, err = ended([*inputs.arguments(command, tmp_path / "out"), "--device", device], env=blind)
    assert (code, len(err.splitlines())) == (2, 2), err
    assert told_in_two_lines(err)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("command", COMMANDS)
def test_terminals_that_are_narrow_or_know_ascii_only(command, inputs, tmp_path):
    env = os.environ | {"COLUMNS": "20", "PYTHONIOENCODING": "ascii", "LANG": "C", "TERM": "dumb"}
    code, out, err = ended(inputs.arguments(command, tmp_path / "out"), env=env)
    assert code == 0, err
    assert "Traceback" not in err and "\x1b" not in out + err
    assert ended([command, "--help"], env=env)[0] == 0
