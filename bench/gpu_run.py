"""Train for a few minutes on a borrowed GPU, going on where the last loan ended, and measure with what time is left.

    PYTHONPATH=src python bench/gpu_run.py --seconds 540 --state STATE --out OUT   # STATE: the OUT of the last loan
    PYTHONPATH=src python bench/gpu_run.py --seconds 60 --device cpu --preset tiny --batch 2 --out OUT   # a rehearsal

evimo need only be on the path. Scenes are drawn by processes, filmed on the GPU and never stored. OUT gets at most
eight files under 16 MiB, from the first minute on and then every half minute: weights (`model.safetensors`), the state
in pieces (`state.0`, ...) with their digests (`state.json`), losses (`log.csv`) and what was measured
(`report.json`). The options of a run must stay the same from loan to loan.
"""

import argparse
import hashlib
import json
import os
import platform
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evimo.errors import BadFile, EvimoError
from evimo.writing import new_file

if TYPE_CHECKING:
    from evimo.training.config import TrainConfig
    from evimo.training.loop import Trainer

PIECE = 15 << 20  # bytes
LARGEST, MOST = 16 << 20, 8  # of a file, and files
SAVE_S = 30.0
MEASURING = 0.2  # share of the time that is kept for measuring, at most
MEASURING_S = 90.0
ROOM_S = 10.0  # that one more measurement may take
PACKAGES = ("numpy", "numba", "numba-cuda", "torch", "scipy", "opencv-python-headless", "h5py", "safetensors")
MODEL, STATE, LOG = "model.safetensors", "state.safetensors", "log.csv"


class TimeIsUp(Exception):
    """The rest of the time is for measuring."""


def join_state(folder: Path, scratch: Path) -> None:
    """Put the pieces of a state together, into the trainer's own folder.

    Raises:
        BadFile: a piece is not what `state.json` says: the loan ended while it was written.
    """
    digests: list[str] = json.loads((folder / "state.json").read_text())["sha256"]
    pieces = [(folder / f"state.{number}").read_bytes() for number in range(len(digests))]
    if [hashlib.sha256(piece).hexdigest() for piece in pieces] != digests:
        raise BadFile(f"the state in {folder} is not whole", fix=f"--preset {folder / MODEL}, which has the weights")
    (scratch / STATE).write_bytes(b"".join(pieces))
    if (folder / LOG).exists():
        (scratch / LOG).write_bytes((folder / LOG).read_bytes())


def split_state(scratch: Path, out: Path, step: int) -> None:
    """Copy the trainer's weights and state, in pieces that are each whole as soon as they exist."""
    content = (scratch / STATE).read_bytes()
    pieces = [content[start : start + PIECE] for start in range(0, len(content), PIECE)]
    for number, piece in enumerate(pieces):
        write(out / f"state.{number}", piece)
    digests = [hashlib.sha256(piece).hexdigest() for piece in pieces]
    write(out / "state.json", json.dumps({"step": step, "sha256": digests}).encode())
    write(out / MODEL, (scratch / MODEL).read_bytes())


def write(path: Path, content: bytes) -> None:
    """Write a file beside and rename it."""
    if len(content) > LARGEST:
        raise BadFile(f"{path} has {len(content)} bytes, which is more than {LARGEST}", fix="a smaller --preset")
    with new_file(path) as file:
        file.write_bytes(content)


@contextmanager
def told(report: dict[str, Any], out: Path, name: str) -> Iterator[None]:
    """Note how long a part took, or why it failed, and write the report: what follows may be cut off."""
    begun_s = time.perf_counter()
    try:
        yield
    except EvimoError:
        raise
    except Exception as error:  # whatever it is, the other parts are worth having
        report[f"{name}_failed"] = f"{type(error).__name__}: {error}"
    report[f"{name}_s"] = round(time.perf_counter() - begun_s, 1)
    write(out / "report.json", json.dumps(report, indent=1).encode())
    print(f"{name}: {report[f'{name}_s']} s {report.get(f'{name}_failed', '')}", flush=True)


@contextmanager
def alarm(until_s: float) -> Iterator[None]:
    """Raise `TimeIsUp` at a time of `time.perf_counter`, also while a scene is waited for."""

    def rings(*_: object) -> None:
        raise TimeIsUp

    signal.signal(signal.SIGALRM, rings)
    signal.setitimer(signal.ITIMER_REAL, max(1e-3, until_s - time.perf_counter()))
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def config_of(options: argparse.Namespace) -> "TrainConfig":
    """The run that the options ask for; `trained` saves by the clock."""
    from evimo.training.config import TrainConfig

    return TrainConfig(
        steps=options.steps,
        batch=options.batch,
        learning_rate=options.learning_rate,
        seed=options.seed,
        save_every=10**9,
        simulate=tuple(options.simulate.split(",")),
        samples_per_slice=options.samples_per_slice,
    )


def note(trainer: "Trainer", out: Path, report: dict[str, Any]) -> None:
    """Copy what the trainer saved last, and how fast it is, to OUT."""
    from evimo.model.checkpoint import load_tensors

    step = load_tensors(trainer.out / STATE)[1]["step"]  # the trainer's own may be ahead, where time was up
    facts = {"step": step, "samples_per_s": trainer.pace.samples_per_s, "waiting": trainer.pace.waited}
    report.update(facts, graph=trainer.learner.replays_graph)
    split_state(trainer.out, out, step)
    if (trainer.out / LOG).exists():
        write(out / LOG, (trainer.out / LOG).read_bytes())
    write(out / "report.json", json.dumps(report, indent=1).encode())
    print(facts, flush=True)


def trained(options: argparse.Namespace, report: dict[str, Any], until_s: float) -> None:
    """Train until a time of `time.perf_counter`, or to the last step."""
    from evimo.training.logs import log_rows
    from evimo.training.start import Workplace, started

    with tempfile.TemporaryDirectory() as name, alarm(until_s):
        scratch = Path(name)
        if options.state and (options.state / "state.json").exists():
            join_state(options.state, scratch)
        workplace = Workplace(out=scratch, device=options.device, workers=options.workers)
        with started([], options.preset, config_of(options), workplace, progress=lambda *_: None) as trainer:
            report["begun_at_step"], saved_s = trainer.step, time.perf_counter()
            with log_rows(scratch / LOG, trainer.step) as log:

                def after(step: int, terms: dict[str, float]) -> None:
                    nonlocal saved_s
                    log(step, terms)
                    report["loss"] = terms["loss"]
                    now_s = time.perf_counter()
                    if step == report["begun_at_step"] + 1 or now_s - saved_s > SAVE_S:
                        saved_s = now_s
                        trainer.save()
                        note(trainer, options.out, report)

                with suppress(TimeIsUp):
                    trainer.run(after)
            if (scratch / STATE).exists():
                note(trainer, options.out, report)


def learning_rates(options: argparse.Namespace, report: dict[str, Any]) -> None:
    """Samples per second of each preset, from batches that are there already."""
    from training import samples_per_s

    for preset in ("tiny", "small", "base"):
        if time.perf_counter() > options.end_s - ROOM_S:
            return
        report[f"{preset}_samples_per_s"] = samples_per_s(preset, options.device, options.batch)


def simulator(options: argparse.Namespace, report: dict[str, Any]) -> None:
    """Speed of the simulator on the GPU and agreement with the CPU, on one scene at a time while time is left."""
    from gpu import SEED, agreement, rates

    from evimo.simulate.plan import RecordingPlan
    from evimo.simulate.recording import simulate_recording

    report["scenes"] = []
    for number in range(1, 7):
        if time.perf_counter() > options.end_s - ROOM_S:
            return
        recording = simulate_recording(RecordingPlan(seed=SEED + number, set_number=number, seconds=0.5, device="cuda"))
        found = agreement(recording, 4) | rates(recording, 128, 1)
        report["scenes"].append({"set": number, **found})
        print(report["scenes"][-1], flush=True)


def machine(options: argparse.Namespace) -> dict[str, Any]:
    """What this is measured on."""
    import torch

    versions: dict[str, str | None] = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = None
    from evimo.training.devices import training_device

    device = training_device(options.device)
    device = "cpu" if device == "cpu" else torch.cuda.get_device_name()
    return {"device": device, "cores": os.cpu_count(), "versions": versions}


def main() -> None:
    """Train, then measure."""
    begun_s = time.perf_counter()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, required=True, help="of all that is done here")
    parser.add_argument("--state", type=Path, help="folder that an earlier loan left")
    parser.add_argument("--out", type=Path, default=Path(os.environ.get("OUT", "out/gpu_run")))
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cuda")
    parser.add_argument("--preset", default="small")
    parser.add_argument("--simulate", default="replica,stress")
    parser.add_argument("--steps", type=int, default=20_000)
    parser.add_argument("--batch", type=int, default=64)
    parser.add_argument("--learning-rate", type=float, default=2e-3)
    parser.add_argument("--samples-per-slice", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=max(1, (os.cpu_count() or 2) - 2))
    options = parser.parse_args()
    options.end_s = begun_s + options.seconds
    options.out.mkdir(parents=True, exist_ok=True)
    report: dict[str, Any] = {}
    try:
        with told(report, options.out, "machine"):
            report |= machine(options)
        with told(report, options.out, "training"), suppress(TimeIsUp):
            trained(options, report, options.end_s - min(MEASURING * options.seconds, MEASURING_S))
        with told(report, options.out, "learning"):
            learning_rates(options, report)
        if options.device == "cuda":
            with told(report, options.out, "simulator"):
                simulator(options, report)
    except EvimoError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    files = [path for path in options.out.iterdir() if path.is_file()]
    print(f"{len(files)} files of {MOST} at most in {options.out}, {time.perf_counter() - begun_s:.0f} s")


if __name__ == "__main__":
    main()
