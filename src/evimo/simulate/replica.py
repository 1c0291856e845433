"""EV-IMO as a whole, simulated: its length, sets, backgrounds and split, in folders of training and test.

The paper gives no counts by background. Those here are of the archives EV-IMO is published in, without `basic` and
`tabletop-egomotion`, which Table I does not know; the six sets then have 3 to 18 sequences (the paper: 3 to 19). The
split is the paper's: box and floor are for training, table, plain wall and fast motion for testing, and some of box
for depth. Tabletops, on which the paper does neither, are for testing here. All sequences are equally long.
"""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import partial
from math import inf
from pathlib import Path

from evimo.errors import BadInput
from evimo.jobs.crew import ALONE, Crew
from evimo.jobs.finishing import finished
from evimo.simulate.dataset import DatasetPlan, write_recording
from evimo.simulate.film import check_device
from evimo.simulate.own_folders import OWN, OwnFolders
from evimo.simulate.plan import SLICE_S, RecordingPlan, camera_of
from evimo.writing import save_text

MINUTES = 32.0
INDEX = "replica.json"


@dataclass(frozen=True, slots=True)
class Group:
    """Sequences of one background in one part. set: of the paper's Table I. room: that they are in, of its set's."""

    part: str
    background: str
    set: int
    room: str
    sequences: int


GROUPS = (
    Group("train", "box", 1, "boxes", 12),
    Group("train", "floor", 2, "floor", 5),
    Group("test", "box", 1, "boxes", 6),
    Group("test", "wall", 2, "wall", 5),
    Group("test", "table", 3, "table", 10),
    Group("test", "tabletop", 4, "tabletop", 5),
    Group("test", "tabletop", 5, "tabletop", 5),
    Group("test", "fast", 6, "boxes", 3),
)
SEQUENCES = sum(group.sequences for group in GROUPS)


@dataclass(frozen=True, kw_only=True)
class Sequence:
    """One sequence, as the index names it; `path` is relative to the replica's folder."""

    path: str
    part: str
    background: str
    set: int
    room: str
    seconds: float
    seed: int


@dataclass(frozen=True, kw_only=True)
class ReplicaPlan:
    """A replica of EV-IMO, filmed by its camera, a DAVIS346.

    minutes: of recording in all; sequences have whole slices of 25 ms, and so has the sum.
    seed: of the first sequence; others follow. size: (height, width) in px, if not the sensor's own.
    device: that films it.
    own: folders of the user's; each part has every other file, so that testing shows nothing that training has.
    """

    minutes: float = MINUTES
    seed: int = 0
    size: tuple[int, int] | None = None
    own: OwnFolders = OWN
    device: str = "cpu"

    def __post_init__(self) -> None:
        if not SEQUENCES * SLICE_S <= self.minutes * 60 < inf:
            least = f"at least {SEQUENCES * SLICE_S / 60:.4f} minutes, a slice for each"
            raise BadInput(f"{self.minutes} minutes for {SEQUENCES} sequences", fix=least)
        self.dataset(self.sequences[0])  # refuses a bad seed or size

    @property
    def sequences(self) -> list[Sequence]:
        """All of them; the first ones are a slice longer than the last where the minutes do not divide evenly."""
        slices, longer = divmod(round(self.minutes * 60 / SLICE_S), SEQUENCES)
        each = [group for group in GROUPS for _ in range(group.sequences)]
        return [
            Sequence(
                path=f"{group.part}/{group.background}/set{group.set}_{self.seed + k:06d}",
                part=group.part,
                background=group.background,
                set=group.set,
                room=group.room,
                seconds=round((slices + (k < longer)) * SLICE_S, 3),
                seed=self.seed + k,
            )
            for k, group in enumerate(each)
        ]

    def dataset(self, sequence: Sequence) -> DatasetPlan:
        """How one sequence is written."""
        recording = RecordingPlan(
            seed=sequence.seed,
            set_number=sequence.set,
            seconds=sequence.seconds,
            camera=camera_of("replica"),
            size=self.size,
            part=sequence.part,
            room=sequence.room,
            own=self.own,
            device=self.device,
            population="replica",
        )
        return DatasetPlan(first=recording, minutes=sequence.seconds / 60)

    def index(self) -> dict[str, object]:
        """What the index says: the plan, and every sequence of it."""
        height, width = self.dataset(self.sequences[0]).first.pixels
        own = {name: fact["sha256"] for name, fact in self.own.facts().items()}
        plan = {
            "minutes": self.minutes,
            "seed": self.seed,
            "width": width,
            "height": height,
            "population": "replica",
            **own,
        }
        plan |= {} if self.device == "cpu" else {"device": self.device}
        return {**plan, "sequences": [asdict(sequence) for sequence in self.sequences]}


def simulate_replica(plan: ReplicaPlan, out: Path, *, crew: Crew = ALONE) -> Iterator[Sequence]:
    """Write the index and the sequences that do not exist yet; yield each sequence when it is complete.

    Raises:
        BadInput: `out` holds a replica of another plan, or there is no such device.
        NotFound, BadFile: as `OwnFolders.check` says.
    """
    plan.own.check()
    check_device(plan.device)
    _write_index(plan, out)
    complete = [sequence for sequence in plan.sequences if (out / sequence.path).exists()]
    yield from complete
    missing = [sequence for sequence in plan.sequences if sequence not in complete]
    work = partial(_write_sequence, plan, out)
    yield from finished(work, missing, crew=crew, shared=out, name=lambda sequence: out / sequence.path)


def _write_sequence(plan: ReplicaPlan, out: Path, sequence: Sequence) -> Sequence:
    path = write_recording(plan.dataset(sequence), (out / sequence.path).parent, sequence.seed)
    assert path == out / sequence.path, path
    return sequence


def _write_index(plan: ReplicaPlan, out: Path) -> None:
    file, text = out / INDEX, json.dumps(plan.index(), indent=1)
    if not file.exists():
        save_text(text, file)
    elif file.read_text() != text:
        raise BadInput(f"{out} holds a replica of another plan", fix="the same command again, or another --out")
