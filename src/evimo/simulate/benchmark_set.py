"""The recordings of `evimo benchmark`: for each background of the paper's tables as much of the replica's test part."""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import partial
from math import inf
from pathlib import Path

from evimo.errors import BadFile, BadInput
from evimo.jobs.crew import ALONE, Crew
from evimo.jobs.finishing import finished
from evimo.recordings.facts import own_version
from evimo.simulate.dataset import DatasetPlan, write_recording
from evimo.simulate.plan import SLICE_S, RecordingPlan
from evimo.writing import save_text

INDEX = "benchmark_set.json"
SEQUENCE_SLICES = 200  # 5 s: as many of these as the minutes give
FEWEST = 3  # sequences of each background, be they as short as it takes


@dataclass(frozen=True, slots=True)
class Kind:
    """What sequences of one background are drawn from. set: of the paper's Table I."""

    background: str
    set: int
    room: str
    population: str = "replica"


KINDS = (
    Kind("table", 3, "table"),
    Kind("wall", 2, "wall"),
    Kind("fast", 6, "boxes"),
    Kind("box", 1, "boxes"),
    Kind("planar", 2, "wall", "planar"),
)
MOVING = sum(kind.population == "replica" for kind in KINDS)
"""Backgrounds that share the minutes; planar sequences, which nothing moves in, come on top, as many as of another."""


@dataclass(frozen=True, kw_only=True)
class TestSequence:
    """One sequence, as the index names it; `path` is relative to the set's folder."""

    path: str
    background: str
    set: int
    room: str
    population: str
    seconds: float
    seed: int


@dataclass(frozen=True, kw_only=True)
class BenchmarkPlan:
    """What a benchmark is made of, by EV-IMO's camera, a DAVIS346.

    minutes: of replica, shared by four backgrounds; planar sequences add a quarter.
    seed: of the first sequence; others follow. size: (height, width) in px, if not the sensor's own.
    """

    minutes: float
    seed: int
    size: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        least = MOVING * FEWEST * SLICE_S / 60
        if not least <= self.minutes < inf:
            problem = f"{self.minutes:g} minutes for {MOVING} backgrounds"
            raise BadInput(problem, fix=f"at least {least:.3g} minutes, {FEWEST} slices for each")
        self.dataset(self.sequences[0])  # refuses a bad seed or size

    @property
    def sequences(self) -> list[TestSequence]:
        """All of them, background by background; the first ones are a slice longer where slices do not divide."""
        slices = round(self.minutes * 60 / MOVING / SLICE_S)
        count = max(FEWEST, round(slices / SEQUENCE_SLICES))
        length, longer = divmod(slices, count)
        return [
            TestSequence(
                path=f"{kind.background}/set{kind.set}_{self.seed + at * count + k:06d}",
                background=kind.background,
                set=kind.set,
                room=kind.room,
                population=kind.population,
                seconds=round((length + (k < longer)) * SLICE_S, 3),
                seed=self.seed + at * count + k,
            )
            for at, kind in enumerate(KINDS)
            for k in range(count)
        ]

    def dataset(self, sequence: TestSequence) -> DatasetPlan:
        """How one sequence is written."""
        recording = RecordingPlan(
            seed=sequence.seed,
            set_number=sequence.set,
            seconds=sequence.seconds,
            camera="evimo",
            size=self.size,
            part="test",
            room=sequence.room,
            population=sequence.population,
        )
        return DatasetPlan(first=recording, minutes=sequence.seconds / 60)

    def index(self) -> dict[str, object]:
        """What the index says: the plan, and every sequence of it."""
        height, width = self.dataset(self.sequences[0]).first.pixels
        plan = {"minutes": self.minutes, "seed": self.seed, "width": width, "height": height, "evimo": own_version()}
        return {**plan, "sequences": [asdict(sequence) for sequence in self.sequences]}


def simulate_benchmark_set(
    plan: BenchmarkPlan, out: Path, *, crew: Crew = ALONE
) -> Iterator[tuple[TestSequence, bool]]:
    """Write the index and the sequences that are missing; yield each when it is complete, and whether it was made now.

    Raises:
        BadInput: `out` holds a set of another plan. BadFile: it holds an index that is none.
    """
    _write_index(plan, out)
    complete = [sequence for sequence in plan.sequences if (out / sequence.path).exists()]
    yield from ((sequence, False) for sequence in complete)
    missing = [sequence for sequence in plan.sequences if sequence not in complete]
    work = partial(_write_sequence, plan, out)
    made = finished(work, missing, crew=crew, shared=out, name=lambda sequence: out / sequence.path)
    yield from ((sequence, True) for sequence in made)


def _write_sequence(plan: BenchmarkPlan, out: Path, sequence: TestSequence) -> TestSequence:
    path = write_recording(plan.dataset(sequence), (out / sequence.path).parent, sequence.seed)
    assert path == out / sequence.path, path
    return sequence


def _write_index(plan: BenchmarkPlan, out: Path) -> None:
    """Write the index, or make sure that the one that is there is of the same plan."""
    file, wanted = out / INDEX, plan.index()
    if not file.exists():
        save_text(json.dumps(wanted, indent=1), file)
        return
    try:
        made = dict(json.loads(file.read_text(encoding="utf-8")))
    except ValueError as error:
        raise BadFile(f"{file} is no index of a benchmark's recordings", fix="another --out") from error
    other = [name for name, value in wanted.items() if made.get(name) != value]
    if other:
        names = [name for name in other if name != "sequences"] or other
        was, now = (", ".join(f"{name} {told.get(name)}" for name in names) for told in (made, wanted))
        was, now = ("other sequences", "these") if names == ["sequences"] else (was, now)
        raise BadInput(
            f"{out} holds recordings of another plan: {was} instead of {now}",
            fix="the same --minutes, --seed and --size as then, or another --out",
        )
