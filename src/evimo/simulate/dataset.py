"""Many recordings, each from its own seed: resumable, in one process or several, or on a cluster."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from math import inf
from pathlib import Path

from evimo.errors import BadInput
from evimo.events.events import Events
from evimo.formats import open_events
from evimo.formats.npz_members import Archive, array_header
from evimo.formats.saving import check_events_format, save_events
from evimo.jobs.crew import ALONE, Crew
from evimo.jobs.finishing import finished
from evimo.recordings.writers import SUFFIXES, Writer, check_dataset_layout, writer_of
from evimo.scene.drawing.scenes import SETS
from evimo.simulate.film import check_device
from evimo.simulate.plan import RecordingPlan
from evimo.simulate.recording import SimulatedRecording, simulate_recording
from evimo.simulate.resuming import check_made_alike


@dataclass(frozen=True, kw_only=True)
class DatasetPlan:
    """Many recordings that are made alike, and how they are stored.

    first: the first one; the others have the seeds that follow. minutes: of recording.
    every_set: whether each is of another set, all of them in turn by seed, whatever the first one says.
    layout: `evimo2`, a folder, or `evimo1`, an .npz.
    events: `aedat4` or `raw` for one more file of the events alone, beside each recording.
    """

    first: RecordingPlan
    minutes: float
    every_set: bool = False
    layout: str = "evimo2"
    events: str | None = None

    def __post_init__(self) -> None:
        check_dataset_layout(self.layout)
        if self.events is not None:
            check_events_format(self.events, self.first.pixels)
        if not 0 < self.minutes < inf:
            raise BadInput(f"{self.minutes} minutes of recordings", fix="a positive number")

    @property
    def seeds(self) -> range:
        """The seeds of the recordings."""
        count = max(1, round(self.minutes * 60 / self.first.seconds))
        return range(self.first.seed, self.first.seed + count)

    def of_seed(self, seed: int) -> RecordingPlan:
        """One of the recordings."""
        set_number = list(SETS)[seed % len(SETS)] if self.every_set else self.first.set_number
        return replace(self.first, seed=seed, set_number=set_number)

    def recording(self, out: Path, seed: int) -> Path:
        """Where one recording goes: a folder or a file, by the layout."""
        return out / f"{self._name(seed)}{SUFFIXES[self.layout]}"

    def events_file(self, out: Path, seed: int) -> Path | None:
        """Where its events go alone, if they do."""
        return out / f"{self._name(seed)}.{self.events}" if self.events else None

    def is_complete(self, out: Path, seed: int) -> bool:
        """Whether a recording, and its file of events, are there."""
        alone = self.events_file(out, seed)
        return self.recording(out, seed).exists() and (alone is None or alone.exists())

    def _name(self, seed: int) -> str:
        return f"set{self.of_seed(seed).set_number}_{seed:06d}"


def simulate_dataset(plan: DatasetPlan, out: Path, *, crew: Crew = ALONE) -> Iterator[Path]:
    """Write the recordings of a plan that do not exist yet, and yield the path of each when it is complete.

    Raises:
        BadInput: a recording that exists was made with another sensor, size, camera, length, folder of the user's or
            device; or there is no such device.
        NotFound, BadFile: as `OwnFolders.check` says.
    """
    plan.first.own.check()
    check_device(plan.first.device)
    paths = (plan.recording(out, seed) for seed in plan.seeds)
    check_made_alike((path for path in paths if path.exists()), plan.first)
    complete = {seed for seed in plan.seeds if plan.is_complete(out, seed)}
    yield from (plan.recording(out, seed) for seed in sorted(complete))
    missing = [seed for seed in plan.seeds if seed not in complete]
    name = partial(plan.recording, out)
    yield from finished(partial(write_recording, plan, out), missing, crew=crew, shared=out, name=name)


def write_recording(plan: DatasetPlan, out: Path, seed: int) -> Path:
    """Simulate one recording, if it is not there yet, and write its events alone if the plan says so."""
    path = plan.recording(out, seed)
    if not path.exists():
        recording = simulate_recording(plan.of_seed(seed))
        with _writer(plan, recording, path) as writer:
            for piece in recording:
                writer.write(piece.events, piece.truth, clutter_bodies=piece.clutter, event_ids=piece.event_ids)
    alone = plan.events_file(out, seed)
    if alone is not None and not alone.exists():
        save_events(_recorded(path), alone, size=plan.first.pixels)
    return path


def _recorded(path: Path) -> Iterable[Events]:
    """The events of a finished recording; a reader would refuse one that has none."""
    if path.is_dir():
        with (path / "dataset_events_t.npy").open("rb") as file:
            rows = array_header(file, str(path)).shape[0]
    else:
        rows = Archive(path).header("events").shape[0]
    return open_events(path) if rows else ()


def _writer(plan: DatasetPlan, recording: SimulatedRecording, path: Path) -> Writer:
    facts, imu = recording.facts(), recording.imu()
    return writer_of(plan.layout, path, recording.camera, poses=recording.poses, facts=facts, imu=imu)
