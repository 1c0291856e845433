"""Many recordings, each from its own seed: resumable, in one process or several."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from math import inf
from pathlib import Path
from typing import Any

from evimo.errors import BadInput
from evimo.events.events import Events
from evimo.formats import open_events
from evimo.formats.npz_members import Archive, array_header
from evimo.formats.saving import check_events_format, save_events
from evimo.recordings.evimo1_writer import Evimo1Writer
from evimo.recordings.facts import own_version
from evimo.recordings.writer import RecordingWriter
from evimo.scene.drawing.scenes import SETS
from evimo.simulate.film import check_device
from evimo.simulate.own_folders import OWN, OwnFolders
from evimo.simulate.populations import check_population
from evimo.simulate.recording import SLICE_S, SimulatedRecording, simulate_recording
from evimo.simulate.resuming import check_made_alike, own_content
from evimo.simulate.sensor import known_sensor
from evimo.simulate.workers import finished

LAYOUTS = {"evimo2": "", "evimo1": ".npz"}


@dataclass(frozen=True, kw_only=True)
class DatasetPlan:
    """What to simulate.

    set_number: 1 to 6, or 0 for all sets in turn. minutes: of recording. seed: of the first recording; others follow.
    seconds: of each recording. camera: `random` or `evimo`. sensor: one of `sensor.SENSORS`.
    size: (height, width) in px, if not the sensor's own. layout: `evimo2`, a folder, or `evimo1`, an .npz.
    events: `aedat4` or `raw` for one more file of the events alone, beside each recording.
    part, room, own, device, population: as in `simulate_recording`.
    """

    set_number: int
    minutes: float
    seed: int
    seconds: float = 1.0
    camera: str = "random"
    sensor: str = "davis346"
    size: tuple[int, int] | None = None
    layout: str = "evimo2"
    events: str | None = None
    part: str | None = None
    room: str | None = None
    own: OwnFolders = OWN
    device: str = "cpu"
    population: str = "stress"

    def __post_init__(self) -> None:
        height, width = self.pixels
        check_population(self.population)
        if self.layout not in LAYOUTS:
            raise BadInput(f"no layout {self.layout!r}", fix=f"one of {', '.join(LAYOUTS)}")
        if self.events is not None:
            check_events_format(self.events, self.pixels)
        if self.set_number not in (0, *SETS):
            raise BadInput(f"no set {self.set_number}", fix="a set from 1 to 6, or all")
        if not 0 < self.minutes < inf:
            raise BadInput(f"{self.minutes} minutes of recordings", fix="a positive number")
        if not SLICE_S <= self.seconds < inf or abs(self.seconds / SLICE_S - round(self.seconds / SLICE_S)) > 1e-6:
            raise BadInput(f"recordings of {self.seconds} s", fix=f"a multiple of {SLICE_S:g} s, the length of a slice")
        if min(height, width) < 16:
            raise BadInput(f"recordings of {width}x{height} px", fix="at least 16x16 px")
        if self.seed < 0:
            raise BadInput(f"seed {self.seed}", fix="a seed from 0")

    @property
    def recordings(self) -> int:
        """How many recordings."""
        return max(1, round(self.minutes * 60 / self.seconds))

    @property
    def seeds(self) -> range:
        """One of each recording."""
        return range(self.seed, self.seed + self.recordings)

    def set_of(self, seed: int) -> int:
        """The set of one recording."""
        return self.set_number or list(SETS)[seed % len(SETS)]

    @property
    def pixels(self) -> tuple[int, int]:
        """Height and width of the recordings, px."""
        kind = known_sensor(self.sensor)
        return self.size or kind.size

    def recording(self, out: Path, seed: int) -> Path:
        """Where one recording goes: a folder or a file, by the layout."""
        return out / f"{self._name(seed)}{LAYOUTS[self.layout]}"

    def events_file(self, out: Path, seed: int) -> Path | None:
        """Where its events go alone, if they do."""
        return out / f"{self._name(seed)}.{self.events}" if self.events else None

    def is_complete(self, out: Path, seed: int) -> bool:
        """Whether a recording, and its file of events, are there."""
        alone = self.events_file(out, seed)
        return self.recording(out, seed).exists() and (alone is None or alone.exists())

    def made_of(self) -> dict[str, Any]:
        """What all its recordings share, in the words of `resuming.as_made`."""
        height, width = self.pixels
        names = ("sensor", "camera", "seconds", "part", "room", "device", "population")
        shared = {name: getattr(self, name) for name in names}
        return {**shared, "size": f"{width}x{height}", **own_content(self.own.facts())}

    def _name(self, seed: int) -> str:
        return f"set{self.set_of(seed)}_{seed:06d}"


def simulate_dataset(plan: DatasetPlan, out: Path, *, workers: int = 1) -> Iterator[Path]:
    """Write the recordings of a plan that do not exist yet, and yield the path of each when it is complete.

    Raises:
        BadInput: a recording that exists was made with another sensor, size, camera, length, folder of the user's or
            device; or there is no such device.
        NotFound, BadFile: as `OwnFolders.check` says.
    """
    plan.own.check()
    check_device(plan.device)
    paths = (plan.recording(out, seed) for seed in plan.seeds)
    check_made_alike((path for path in paths if path.exists()), plan.made_of())
    complete = {seed for seed in plan.seeds if plan.is_complete(out, seed)}
    yield from (plan.recording(out, seed) for seed in sorted(complete))
    missing = [seed for seed in plan.seeds if seed not in complete]
    yield from finished(partial(write_recording, plan, out), missing, workers)


def write_recording(plan: DatasetPlan, out: Path, seed: int) -> Path:
    """Simulate one recording, if it is not there yet, and write its events alone if the plan says so."""
    path = plan.recording(out, seed)
    if not path.exists():
        recording = simulate_recording(
            seed,
            set_number=plan.set_of(seed),
            seconds=plan.seconds,
            camera=plan.camera,
            sensor=plan.sensor,
            size=plan.size,
            part=plan.part,
            room=plan.room,
            own=plan.own,
            device=plan.device,
            population=plan.population,
        )
        with _writer(plan, recording, path) as writer:
            for piece in recording:
                writer.write(piece.events, piece.truth, clutter_bodies=piece.clutter, event_ids=piece.event_ids)
    alone = plan.events_file(out, seed)
    if alone is not None and not alone.exists():
        save_events(_recorded(path), alone, size=plan.pixels)
    return path


def _recorded(path: Path) -> Iterable[Events]:
    """The events of a finished recording; a reader would refuse one that has none."""
    if path.is_dir():
        with (path / "dataset_events_t.npy").open("rb") as file:
            rows = array_header(file, str(path)).shape[0]
    else:
        rows = Archive(path).header("events").shape[0]
    return open_events(path) if rows else ()


def _writer(plan: DatasetPlan, recording: SimulatedRecording, path: Path) -> RecordingWriter | Evimo1Writer:
    facts = {"version": own_version(), "camera_kind": plan.camera, **recording.facts()}
    writer = Evimo1Writer if plan.layout == "evimo1" else RecordingWriter
    return writer(path, recording.camera, facts=facts, poses=recording.poses, imu=recording.imu())
