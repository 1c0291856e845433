"""A finished benchmark: every tally with what it is of; tables, plots and pages are made from it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby

from evimo.benchmark import cases
from evimo.benchmark.scenes import PLANAR, SCENES
from evimo.benchmark.scoring import TRIVIAL
from evimo.benchmark.tables import ResultTable, tables_of, total
from evimo.benchmark.tally import Tally
from evimo.benchmark.worst import WorstCase
from evimo.evaluation.columns import CONVENTIONS
from evimo.evaluation.report import MODEL


@dataclass(frozen=True)
class Result:
    """What a benchmark found.

    settings:  what made the recordings, by name.
    rivals:    models in the order of the tables, the trivial answers last.
    tallies:   by the model's name and the sequence's.
    worst:     the worst masks of the first model.
    """

    settings: Mapping[str, str]
    sequences: Sequence[cases.Sequence]
    rivals: Sequence[cases.Rival]
    tallies: Mapping[tuple[str, str], Tally]
    worst: Sequence[WorstCase] = field(default_factory=tuple[WorstCase, ...])

    @cached_property
    def simulated(self) -> int:
        """How many of the recordings say that our simulator made them, which every page then says."""
        return sum("seed" in sequence.recording.meta for sequence in self.sequences)

    @property
    def title(self) -> str:
        """What was measured on; others' recordings do not say whether they are real."""
        alone = self.simulated == len(self.sequences)
        return f"EV-IMO’s experiments{' on simulated recordings' if alone else ''}"

    @property
    def models(self) -> list[str]:
        """Names of the models, without the trivial answers."""
        return [rival.name for rival in self.rivals if rival.name != TRIVIAL]

    @cached_property
    def by_scene(self) -> dict[str, dict[str, Tally]]:
        """Tallies by the model's name and by scene."""
        return {
            rival.name: {
                scene: total(self.tallies[rival.name, sequence.name] for sequence in group)
                for scene, group in self._scenes.items()
            }
            for rival in self.rivals
        }

    @cached_property
    def tables(self) -> list[ResultTable]:
        """The paper's tables of these numbers."""
        return tables_of(self.by_scene, models=self.models, trivial=TRIVIAL)

    def total(self, rival: str) -> Tally:
        """Everything of one model, but for what has no objects to find by design: planar recordings."""
        scenes = self.by_scene[rival]
        return total(tally for scene, tally in scenes.items() if scene != PLANAR or len(scenes) == 1)

    def of_sequence(self, rival: str, sequence: cases.Sequence) -> Mapping[str, float | None]:
        """All numbers of one model on one sequence."""
        scores = self.tallies[rival, sequence.name].rows.get(MODEL, {})
        return {name: score.value for name, score in scores.items()}

    @property
    def facts(self) -> dict[str, str]:
        """What a reader needs to check the numbers: recordings, seeds, models, what was kept."""
        facts = dict(self.settings)
        for scene, group in self._scenes.items():
            title = SCENES[scene].title if scene in SCENES else scene
            counts = self.by_scene[TRIVIAL][scene].counts
            facts[f"recordings of {title}"] = f"{len(group)}, {_kept(counts)}{_seeds(group)}"
        for rival in self.rivals:
            identity = ", ".join(f"{name} {value}" for name, value in rival.identity.items())
            facts[f"model {rival.name}" if rival.name != TRIVIAL else rival.name] = identity
        return facts

    @property
    def conventions(self) -> tuple[str, ...]:
        """How everything was measured: window, support, thresholds, scale."""
        return CONVENTIONS

    @cached_property
    def _scenes(self) -> dict[str, list[cases.Sequence]]:
        order = [*SCENES, *sorted({sequence.scene for sequence in self.sequences} - SCENES.keys())]
        ordered = sorted(self.sequences, key=lambda sequence: (order.index(sequence.scene), sequence.name))
        return {scene: list(group) for scene, group in groupby(ordered, key=lambda sequence: sequence.scene)}

    @property
    def ordered(self) -> list[cases.Sequence]:
        """The sequences, scene by scene in the tables' order."""
        return [sequence for group in self._scenes.values() for sequence in group]


def _kept(counts: Mapping[str, int]) -> str:
    words = (
        "slices",
        "slices with movers",
        "slices with the camera at rest",
        "slices without events or truth",
    )
    return ", ".join(f"{counts[name]:,} {name}" for name in words if counts.get(name))


def _seeds(group: Sequence[cases.Sequence]) -> str:
    seeds = sorted(seed for sequence in group if isinstance(seed := sequence.recording.meta.get("seed"), int))
    if len(seeds) < len(group):
        return ""
    if len(seeds) == 1:
        return f", seed {seeds[0]}"
    whole = seeds[-1] - seeds[0] + 1 == len(seeds)
    return f", seeds {seeds[0]} to {seeds[-1]}" if whole else f", seeds {', '.join(map(str, seeds))}"
