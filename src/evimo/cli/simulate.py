"""`evimo simulate`: recordings with exact truth from seeds."""

import re
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, TextColumn, TimeRemainingColumn
from rich.text import Text

from evimo.errors import BadInput
from evimo.writing import make_folder

if TYPE_CHECKING:
    from evimo.simulate.dataset import DatasetPlan
    from evimo.simulate.own_folders import OwnFolders
    from evimo.simulate.replica import ReplicaPlan

REPLICA_TAKES = "--minutes, --seed, --size, --texture-dir, --mesh-dir, --workers, --device"


def simulate(
    *,
    set: str = "all",
    minutes: float | None = None,
    seed: int = 0,
    out: Path,
    sensor: Literal["davis346", "davis240", "dvxplorer", "gen4", "samsung"] = "davis346",
    size: str | None = None,
    seconds: float = 1.0,
    camera: Literal["random", "evimo"] | None = None,
    population: Literal["stress", "replica"] = "stress",
    part: Literal["train", "test"] | None = None,
    layout: Literal["evimo2", "evimo1"] = "evimo2",
    events: Literal["aedat4", "raw"] | None = None,
    texture_dir: Path | None = None,
    mesh_dir: Path | None = None,
    workers: int = 1,
    device: Literal["cpu", "cuda"] = "cpu",
    replica: bool = False,
) -> None:
    """Simulate recordings of a moving event camera with exact depth, ids and motion.

    Each recording is a folder (or, as evimo1, a file) made from its own seed, complete as soon as it exists; the same
    command again makes only those that are missing.

    With --replica, EV-IMO as a whole: 51 recordings of its camera over its six sets, by the paper's split in
    out/train and out/test, listed in out/replica.json. Textures and shapes of objects are never the same in both.

    Args:
        set: one of the paper's six sets, 1 to 6, or all of them in turn.
        minutes: of recording, together; must be said, but for a replica, which has EV-IMO's 32 by default.
        seed: of the first recording; the others follow.
        out: folder for the recordings.
        sensor: size, thresholds and noise of this event camera.
        size: WxH in pixels, if not the sensor's own.
        seconds: of each recording; whole slices of 0.025 s.
        camera: random lenses, or EV-IMO's own scaled to the size, which is what the population replica has by default.
        population: of scenes; stress is harder than what people film, replica is toys played with, as in EV-IMO.
        part: train or test; textures, and shapes or some kinds of toys, of one are never in the other.
        layout: of EVIMO2, a folder, which is what the other commands take, or of EV-IMO's first version, an .npz.
        events: beside each recording, its events alone as AEDAT 4 or as Prophesee RAW (EVT 2.0).
        texture_dir: folder of PNG and JPEG pictures; textures are cut from them, besides those of the package.
        mesh_dir: folder of PLY, OBJ, STL, OFF and GLB files, or scans of points as PLY; four in ten things are these.
        workers: processes.
        device: that renders and fires the pixels; cuda is an NVIDIA GPU, of which all workers have their share; it
            needs evimo[cuda], and its events differ a little from the CPU's.
        replica: of EV-IMO; takes minutes, seed, size, workers, device and both folders, none of the other choices.
    """
    from evimo.simulate.film import check_device
    from evimo.simulate.own_folders import OwnFolders
    from evimo.simulate.workers import check_workers

    check_device(device)
    check_workers(workers)
    own = OwnFolders(texture_dir, mesh_dir)
    if replica:
        given = (set, sensor, seconds, camera, layout, events, population, part)
        if given != ("all", "davis346", 1.0, None, "evimo2", None, "stress", None):
            raise BadInput("a replica has its own sets, sensor, camera and lengths", fix=REPLICA_TAKES)
        from evimo.simulate.replica import MINUTES, ReplicaPlan

        minutes = MINUTES if minutes is None else minutes
        replica_plan = ReplicaPlan(minutes=minutes, seed=seed, size=_size(size), own=own, device=device)
        _write_replica(replica_plan, out, workers)
        return
    if minutes is None:
        raise BadInput("no length", fix="--minutes M, or --replica")
    from evimo.simulate.dataset import DatasetPlan

    plan = DatasetPlan(
        set_number=_set_number(set),
        minutes=minutes,
        seed=seed,
        seconds=seconds,
        camera=camera or ("evimo" if population == "replica" else "random"),
        sensor=sensor,
        size=_size(size),
        layout=layout,
        events=events,
        part=part,
        own=own,
        device=device,
        population=population,
    )
    _write_dataset(plan, out, workers)


def _write_dataset(plan: "DatasetPlan", out: Path, workers: int) -> None:
    from evimo.simulate.dataset import simulate_dataset

    _read(plan.own)
    make_folder(out)
    columns = (TextColumn("simulate"), BarColumn(), MofNCompleteColumn(), _Rate(), TimeRemainingColumn())
    with Progress(*columns) as progress:
        task = progress.add_task("recordings", total=plan.recordings)
        for _ in simulate_dataset(plan, out, workers=workers):
            progress.advance(task)


def _read(own: "OwnFolders") -> None:
    """Read the user's files once: what is wrong with them is said before anything is written."""
    if own.meshes is not None:
        print(f"reading the meshes of {own.meshes}", file=sys.stderr)
    own.check()


def _write_replica(plan: "ReplicaPlan", out: Path, workers: int) -> None:
    """Show seconds of recording made, how fast, and the time left: by the bar, or a line each without a terminal."""
    from evimo.simulate.replica import simulate_replica

    sequences = plan.sequences
    _read(plan.own)
    make_folder(out)
    total_s = sum(sequence.seconds for sequence in sequences)
    present = {sequence.path for sequence in sequences if (out / sequence.path).exists()}
    begun, made_s, done_s = time.perf_counter(), 0.0, 0.0
    with Progress(TextColumn("replica"), BarColumn(), TextColumn("{task.fields[said]}")) as progress:
        task = progress.add_task("", total=total_s, said=f"{total_s:.0f} s")
        for sequence in simulate_replica(plan, out, workers=workers):
            done_s += sequence.seconds
            made_s += 0 if sequence.path in present else sequence.seconds
            said = f"{done_s:.0f} of {total_s:.0f} s"
            if made_s:
                per_s = made_s / (time.perf_counter() - begun)
                said += f", {per_s:.3f} s of recording per s, {(total_s - done_s) / per_s / 60:.1f} min left"
            progress.update(task, advance=sequence.seconds, said=said)
            if made_s and not progress.console.is_terminal:
                progress.console.print(f"{sequence.path}: {said}", soft_wrap=True)


class _Rate(ProgressColumn):
    """Recordings per second."""

    def render(self, task) -> Text:  # type: ignore[no-untyped-def]
        speed = task.finished_speed or task.speed
        return Text(f"{speed:.2f} recordings/s" if speed else "", style="progress.data.speed")


def _set_number(text: str) -> int:
    if text != "all" and text not in tuple("123456"):
        raise BadInput(f"no set {text!r}", fix="a set from 1 to 6, or all")
    return 0 if text == "all" else int(text)


def _size(text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    match = re.fullmatch(r"(\d+)x(\d+)", text)
    if not match:
        raise BadInput(f"no size {text!r}", fix="WxH, as 346x260")
    return int(match[2]), int(match[1])
