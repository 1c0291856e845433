"""`evimo simulate`: recordings with exact truth from seeds."""

import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from evimo.cli.progress import progress
from evimo.errors import BadInput, check_installed
from evimo.jobs.crew import ALONE, Crew
from evimo.writing import make_folder

if TYPE_CHECKING:
    from evimo.simulate.dataset import DatasetPlan
    from evimo.simulate.own_folders import OwnFolders
    from evimo.simulate.replica import ReplicaPlan

SIMULATING = ("scipy", "skimage", "trimesh")
REPLICA_TAKES = "--minutes, --seed, --size, --texture-dir, --mesh-dir, --workers, --dask, --device"


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
    crew: Annotated[Crew, Parameter(name="*")] = ALONE,
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
        crew: who simulates.
        device: that renders and fires the pixels; cuda is an NVIDIA GPU, of which all workers have their share; it
            needs evimo[cuda], and its events differ a little from the CPU's.
        replica: of EV-IMO; takes minutes, seed, size, workers, dask, device and both folders, nothing else.
    """
    check_installed("simulating", *SIMULATING, extra="simulate")
    from evimo.simulate.film import check_device
    from evimo.simulate.own_folders import OwnFolders

    check_device(device)
    crew.check()
    own, pixels = OwnFolders(texture_dir, mesh_dir), _size(size)
    if replica:
        given = (set, sensor, seconds, camera, layout, events, population, part)
        if given != ("all", "davis346", 1.0, None, "evimo2", None, "stress", None):
            raise BadInput("a replica has its own sets, sensor, camera and lengths", fix=REPLICA_TAKES)
        from evimo.simulate.replica import MINUTES, ReplicaPlan

        length = MINUTES if minutes is None else minutes
        _write_replica(ReplicaPlan(minutes=length, seed=seed, size=pixels, own=own, device=device), out, crew)
        return
    if minutes is None:
        raise BadInput("no length", fix="--minutes M, or --replica")
    from evimo.simulate.dataset import DatasetPlan
    from evimo.simulate.plan import RecordingPlan, camera_of

    made = {"sensor": sensor, "camera": camera or camera_of(population), "population": population, "device": device}
    first = RecordingPlan(
        seed=seed, set_number=_set_number(set), seconds=seconds, size=pixels, part=part, own=own, **made
    )
    plan = DatasetPlan(first=first, minutes=minutes, every_set=set == "all", layout=layout, events=events)
    _write_dataset(plan, out, crew)


def _write_dataset(plan: "DatasetPlan", out: Path, crew: Crew) -> None:
    from evimo.simulate.dataset import simulate_dataset

    _read(plan.first.own)
    make_folder(out)
    there = sum(plan.is_complete(out, seed) for seed in plan.seeds)
    with progress(len(plan.seeds), "recordings") as advance:
        for number, _ in enumerate(simulate_dataset(plan, out, crew=crew)):
            advance(made=number >= there)
    print(f"{len(plan.seeds)} recordings in {out}, {len(plan.seeds) - there} of them made now")


def _read(own: "OwnFolders") -> None:
    """Read the user's files once: what is wrong with them is said before anything is written."""
    if own.meshes is not None:
        print(f"reading the meshes of {own.meshes}", file=sys.stderr)
    own.check()


def _write_replica(plan: "ReplicaPlan", out: Path, crew: Crew) -> None:
    from evimo.simulate.replica import simulate_replica

    _read(plan.own)
    make_folder(out)
    present = {sequence.path for sequence in plan.sequences if (out / sequence.path).exists()}
    with progress(round(sum(sequence.seconds for sequence in plan.sequences), 3), "s of recording") as advance:
        for sequence in simulate_replica(plan, out, crew=crew):
            advance(sequence.seconds, made=sequence.path not in present, facts=sequence.path)
    print(f"{len(plan.sequences)} recordings in {out}, {len(plan.sequences) - len(present)} of them made now")


def _set_number(text: str) -> int:
    """The set that is asked for; of all of them the first."""
    if text != "all" and text not in tuple("123456"):
        raise BadInput(f"no set {text!r}", fix="a set from 1 to 6, or all")
    return 1 if text == "all" else int(text)


def _size(text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    match = re.fullmatch(r"(\d+)x(\d+)", text)
    if not match:
        raise BadInput(f"no size {text!r}", fix="WxH, as 346x260")
    return int(match[2]), int(match[1])
