"""Every command on machines as they are: without a home, on a full disk, without a reader, ended by signals.

    python bench/machines.py [COMMAND...]

Prints a table in Markdown: the exit code, the line that was said, and what was left that should not be. It needs Linux
and root, to become a user without rights and to mount a disk of 200 kB; what is not permitted is said in the table. The
exit code is 1 where anything is not as `docs/machines.md` has it.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from machines_captures import mirror, save_capture, save_fragments, save_scan
from machines_wand import save_collected

ROOT = Path(__file__).parents[1]
NOBODY = 65534
# It may read what only root may, such as a Python below /root, and write nothing.
AS_NOBODY = [
    *("setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups"),
    *("--inh-caps=+dac_read_search", "--ambient-caps=+dac_read_search"),
    *("env", "-i", "PATH=/usr/bin:/bin", "HOME=/nonexistent", "LANG=C.UTF-8", f"PYTHONPATH={ROOT / 'src'}"),
]
SIGNALS = (signal.SIGTERM, signal.SIGHUP, signal.SIGINT)
COMMANDS = (
    *("info", "check", "run", "view", "evaluate", "evaluate --truth", "realism", "simulate", "benchmark", "train"),
    *("convert", "annotate", "locate-markers", "align-room", "calibrate", "download"),
)
READING = ("info", "check")  # they write nothing
LONGEST_S = 600


@dataclass(frozen=True)
class Inputs:
    """Files that commands read: a recording of 20 s, recordings with truth, a mask for each slice of one of them.

    others: a folder with a capture, fragments of a room, scans and images of a wand. server: of archives.
    """

    recording: Path
    simulated: Path
    masks: Path
    others: Path
    server: str = ""
    model: str = "tiny"

    def arguments(self, command: str, out: Path, *, long: bool = False) -> list[str]:
        """Of the command, which writes below `out`: as short a work as there is, or one that a signal can end."""
        films = sorted(map(str, self.simulated.iterdir()))
        used = films if long else films[:1]
        some = str(self.others / ("many" if long else "one"))
        short = [] if long else ["--stop", "0.3"]
        finely = ["--spacing", "2"] if long else []
        made = ["--minutes", "5" if long else "0.003", "--seconds", "0.1", "--size", "64x48", "--set", "1"]
        each = {
            "info": [str(self.recording)],
            "run": [str(self.recording), "--model", self.model, *short, "--out", str(out)],
            "view": [str(self.recording), *short, "--save", str(out / "film.mp4")],
            "evaluate": [*used, "--model", self.model, "--out", str(out)],
            "evaluate --truth": [str(self.masks), "--truth", films[0], "--out", str(out)],
            "realism": [str(self.recording), "--simulated", str(self.simulated), "--out", str(out)],
            "simulate": [*made, "--out", str(out)],
            "benchmark": [*(made[:2] if long else ("--data", films[0])), "--models", self.model, "--out", str(out)],
            "check": [str(self.recording)],
            "convert": [*used, "--layout", "hdf5", "--out", str(out)],
            "annotate": [str(self.others / "capture"), "--rate", "1000" if long else "10", "--out", str(out)],
            "locate-markers": [f"{some}.ply", "--out", str(out)],
            "align-room": [str(self.others / "fragments.yaml"), "--out", str(out / "room.ply"), *finely],
            "calibrate": [
                *(some, "--target", str(self.others / "wand.yaml"), "--calibration", str(self.others / "lens.txt")),
                *("--out", str(out / "calibration.yaml")),
            ],
            "download": ["eval/box", "--mirror", self.server + "/slow" * long, "--out", str(out)],
            "train": [*used, "--steps", "9999" if long else "2", "--preset", "tiny", "--batch", "1", "--out", str(out)],
        }
        return [command.split()[0], *each[command]]


def made_inputs(folder: Path, *, model: str = "tiny") -> Inputs:
    """Make them: noise, half a second repeated in time; and eight copies of a simulated recording."""
    from evimo.recordings.recording import open_recording
    from evimo.simulate.dataset import DatasetPlan, simulate_dataset
    from evimo.simulate.plan import RecordingPlan

    rng = np.random.default_rng(0)
    noise = np.stack([np.sort(rng.integers(0, 500_000, 50_000)), *rng.integers(0, (64, 48, 2), (50_000, 3)).T], axis=1)
    rows = np.concatenate([noise + [500_000 * k, 0, 0, 0] for k in range(40)])
    np.savetxt(folder / "noise.txt", rows, fmt="%d")
    first = RecordingPlan(seed=3, set_number=1, seconds=0.2, size=(48, 64))
    list(simulate_dataset(DatasetPlan(first=first, minutes=0.2 / 60), folder / "one"))
    one = next((folder / "one").iterdir())
    for k in range(8):
        shutil.copytree(one, folder / "simulated" / f"{one.name}_{k}")
    film = open_recording(one)
    np.savez(folder / "masks.npz", ids=np.stack([film.truth(k).ids for k in range(len(film))]), times=film.times_us)
    if os.geteuid() == 0:  # training prepares recordings where they lie
        for path in (folder / "simulated").rglob("*"):
            os.chown(path, NOBODY, NOBODY)
    others = folder / "others"
    others.mkdir()
    save_capture(others / "capture", recording=folder / "noise.txt")
    save_fragments(others)
    for name, balls, images in ("one", 1, 60), ("many", 40, 1500):
        save_scan(others / f"{name}.ply", balls=balls)
        save_collected(others / name, images=images)
    return Inputs(folder / "noise.txt", folder / "simulated", folder / "masks.npz", others, mirror(), model)


class Ended(NamedTuple):
    """How a command ended."""

    code: int
    err: str


def started(arguments: list[str], *, before: list[str] | None = None, **how: Any) -> subprocess.Popen[str]:
    """The command in a process of its own."""
    how = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True} | how
    how["env"] = os.environ | {"PYTHONPATH": str(ROOT / "src")}  # wherever it runs
    return subprocess.Popen([*(before or []), sys.executable, "-m", "evimo", *arguments], **how)


def ended(arguments: list[str], **how: Any) -> Ended:
    """The end of a command."""
    process = started(arguments, **how)
    _, err = process.communicate(timeout=LONGEST_S)
    return Ended(process.returncode, err or "")


def signalled(arguments: list[str], number: int, *, works: Callable[[int], bool]) -> Ended:
    """A command that gets a signal as soon as it works: it is halted until the signal is there."""
    process = started(arguments)
    until = time.monotonic() + LONGEST_S
    while not works(process.pid) and process.poll() is None and time.monotonic() < until:
        time.sleep(0.001)
    for each in (signal.SIGSTOP, number, signal.SIGCONT):
        process.send_signal(each)
    _, err = process.communicate(timeout=LONGEST_S)
    return Ended(process.returncode, err)


def at_work(command: str, inputs: Inputs, out: Path) -> Callable[[int], bool]:
    """Whether the process of a command does what it is for: it reads the recording, or has made its folder."""

    def reads(pid: int) -> bool:
        try:
            return any(os.readlink(each) == str(inputs.recording) for each in Path(f"/proc/{pid}/fd").iterdir())
        except OSError:
            return False

    if command in ("info", "check", "realism"):
        return reads
    if command in ("locate-markers", "align-room", "calibrate"):  # they make nothing before they are done
        return lambda pid: _worked_s(pid) > 1.5
    return lambda pid: out.exists() and (command not in ("run", "view", "download") or any(out.iterdir()))


def _worked_s(pid: int) -> float:
    """Processor time of a process."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@contextmanager
def disk(place: Path, *, left_kb: int = 20) -> Iterator[Path | None]:
    """A disk of 200 kB with some left; None where mounting is not permitted."""
    place.mkdir()
    done = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=200k", "tmpfs", str(place)], capture_output=True)
    if done.returncode:
        yield None
        return
    try:
        (place / "fill").write_bytes(bytes((200 - left_kb) * 1024))
        yield place
    finally:
        subprocess.run(["umount", str(place)], check=True)


class Row(NamedTuple):
    """One line of the table; `left` should be empty."""

    command: str
    machine: str
    expected: tuple[int, ...]
    end: Ended | None
    left: list[str]
    silent: bool = False

    @property
    def said(self) -> str:
        """The line that says how it ended."""
        lines = [] if self.end is None else self.end.err.splitlines()
        ends = [line for line in lines if line.startswith(("error: ", "interrupted", "ended by ", "this is a bug"))]
        return ends[-1] if ends else ""

    @property
    def right(self) -> bool:
        """Whether it is as the documentation says."""
        if self.end is None:
            return True
        one_line = bool(self.said) != (self.silent or self.end.code in (0, 3))
        return self.end.code in self.expected and one_line and "Traceback" not in self.end.err and not self.left

    def written(self, folder: Path) -> str:
        """As a row of Markdown."""
        if self.end is None:
            return f"| {self.command} | {self.machine} | not permitted here | | | |"
        said = re.sub(r"\|", "/", self.said.replace(str(folder), "…"))[:90] or "–"
        traceback = "yes" if "Traceback" in self.end.err else "none"
        cells = (self.command, self.machine, self.end.code, said, ", ".join(self.left) or "nothing", traceback)
        return "| " + " | ".join(map(str, cells)) + (" |" if self.right else " | **wrong**")


def hidden_in(folder: Path) -> list[str]:
    """What is unfinished below a folder."""
    return sorted(str(path.relative_to(folder)) for path in folder.rglob(".*"))


def rows(command: str, inputs: Inputs, folder: Path) -> Iterator[Row]:
    """The command on every machine."""
    yield without_home(command, inputs, folder / "nobody")
    yield from on_full_disk(command, inputs, folder / "disk")
    out = folder / "out"
    read, write = os.pipe()
    os.close(read)
    end = ended(inputs.arguments(command, out / "pipe"), stdout=write)
    os.close(write)
    yield Row(command, "`\\| head -0`", (2,), end, hidden_in(folder), silent=True)
    with open("/dev/full", "w") as full:
        end = ended(inputs.arguments(command, out / "f"), stdout=full)
    yield Row(command, "`> /dev/full`", (2,), end, hidden_in(out))
    for number in SIGNALS:
        place = out / number.name
        arguments = inputs.arguments(command, place, long=True)
        end = signalled(arguments, number, works=at_work(command, inputs, place))
        yield Row(command, number.name, (128 + number,), end, hidden_in(place))


def on_full_disk(command: str, inputs: Inputs, folder: Path) -> Iterator[Row]:
    """What is finished may stay, as the next try goes on from it; that this one ends well shows that it is whole."""
    good = (0, 3) if command == "check" else (0,)
    left_kb = 0 if command == "locate-markers" else 20  # its list is small
    with disk(folder, left_kb=left_kb) as place:
        arguments = inputs.arguments(command, folder / "out")
        end = ended(arguments, cwd=place) if place else None
        yield Row(command, "full disk", good if command in READING else (2,), end, hidden_in(folder))
        if place:
            subprocess.run(["mount", "-o", "remount,size=1g", str(place)], check=True)
        end = ended(arguments, cwd=place) if place else None
        yield Row(command, "the same again, with room", good, end, hidden_in(folder))


def without_home(command: str, inputs: Inputs, place: Path) -> Row:
    """As a user without a home, in a folder and an installation that it cannot write; the output is its own."""
    good = (0, 3) if command == "check" else (0,)
    (place / "unwritable").mkdir(parents=True)
    own = place / "own"
    own.mkdir()
    os.chown(own, NOBODY, NOBODY)
    try:
        end = ended(inputs.arguments(command, own / "out"), before=AS_NOBODY, cwd=place / "unwritable")
    except FileNotFoundError:
        return Row(command, "no home, read-only", good, None, [])
    if end.err.startswith("setpriv:"):
        return Row(command, "no home, read-only", good, None, [])
    return Row(command, "no home, read-only", good, end, hidden_in(place))


def main(commands: list[str]) -> int:
    """Print the table."""
    # Commands of a background job would ignore the one, those below `nohup` the other: what is caught, they take anew.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, lambda *_: None)
    print("| command | machine | exit code | said | left | traceback |\n|---|---|---|---|---|---|")
    wrong = 0
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        folder.chmod(0o755)
        inputs = made_inputs(folder)
        for command in commands or COMMANDS:
            place = folder / "tried" / command.replace(" ", "")
            place.mkdir(parents=True)
            for row in rows(command, inputs, place):
                print(row.written(folder), flush=True)
                if not row.right:
                    wrong += 1
                    print(row.end.err if row.end else "", file=sys.stderr)
            shutil.rmtree(place)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
