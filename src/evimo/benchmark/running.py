"""The whole benchmark: recordings made or found, every model scored on each, the worst looked at, files written."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from evimo.benchmark.cases import Case, Kept, Rival, Sequence, case_of, score, sequences_in
from evimo.benchmark.page import as_html
from evimo.benchmark.result import Result
from evimo.benchmark.tally import Tally
from evimo.benchmark.texts import as_csv, as_json, as_markdown
from evimo.benchmark.worst import WorstCase, worst_cases
from evimo.errors import BadInput
from evimo.jobs.crew import Crew
from evimo.jobs.finishing import finished
from evimo.recordings.facts import own_version
from evimo.writing import save_files

if TYPE_CHECKING:
    from evimo.simulate.benchmark_set import BenchmarkPlan

MODELS = ("base", "small", "tiny", "classical", "ecn")
"""What stands in every table unless other models are named, best first."""
SCORES, RECORDINGS = "scores", "recordings"
FILES = ("benchmark.md", "benchmark.csv", "benchmark.json", "benchmark.html")


class Advance(Protocol):
    """Called as work is finished; that which was there before is not `made`."""

    def __call__(self, amount: float = 1, *, made: bool = True, facts: str = "") -> None:
        """Count more finished units."""
        ...


Progress = Callable[[float, str], AbstractContextManager[Advance]]


def make_recordings(plan: "BenchmarkPlan", out: Path, *, crew: Crew, progress: Progress) -> Path:
    """Make what is missing of the benchmark's recordings below `out`, and return their folder.

    Raises:
        BadInput: there are recordings of another plan.
    """
    from evimo.simulate.benchmark_set import simulate_benchmark_set

    folder = out / RECORDINGS
    with progress(round(sum(sequence.seconds for sequence in plan.sequences), 3), "s of recording") as advance:
        for sequence, made in simulate_benchmark_set(plan, folder, crew=crew):
            advance(sequence.seconds, made=made, facts=sequence.path)
    return folder


def settings_of(plan: "BenchmarkPlan") -> dict[str, str]:
    """What made the recordings, for a reader who wants to make them again."""
    height, width = plan.dataset(plan.sequences[0]).first.pixels
    command = f"evimo benchmark --minutes {plan.minutes:g} --seed {plan.seed}"
    made = f"{sum(sequence.seconds for sequence in plan.sequences) / 60:.2f} minutes, {width}x{height} px"
    size = "" if plan.size is None else f" --size {width}x{height}"
    return {"made by": f"{command}{size} --out DIR", "recordings": f"{made}, population replica, its test part"}


def benchmark(
    folder: Path, out: Path, *, rivals: list[Rival], settings: Mapping[str, str], crew: Crew, progress: Progress
) -> Result:
    """Score `rivals_of` some models on all recordings in a folder, and keep tables, plots and pictures in `out`.

    What was scored there before, by the same model on the same recording, is not scored again.

    Raises:
        NotFound, BadFile: recordings. BadInput: two of one name, or `out` cannot be written.
    """
    sequences, kept = sequences_in(folder), Kept(out / SCORES)
    if twice := {sequence.name for sequence in sequences if [each.name for each in sequences].count(sequence.name) > 1}:
        raise BadInput(f"two recordings are called {min(twice)}", fix="other names")
    tallies: dict[tuple[str, str], Tally] = {}
    missing: list[Case] = []
    with progress(len(rivals) * sum(len(sequence.recording) for sequence in sequences), "slices") as advance:
        for sequence in sequences:
            known = {rival.name: kept.known(rival, sequence) for rival in rivals}
            there = {(name, sequence.name): tally for name, tally in known.items() if tally is not None}
            tallies |= there
            advance(len(there) * len(sequence.recording), made=False)
            if len(there) < len(rivals):
                missing.append(case_of(sequence, (rival for rival in rivals if known[rival.name] is None)))
        for case, found in _scored(kept, missing, crew=crew, shared=out, advance=advance):
            tallies |= {(name, case.name): tally for name, tally in found.items()}
    result = Result(
        settings={**settings, "evimo": own_version()},
        sequences=sequences,
        rivals=rivals,
        tallies=tallies,
        worst=_worst(rivals[0], sequences, tallies),
    )
    contents = (as_markdown(result), as_csv(result), as_json(result), as_html(result))
    save_files(out, dict(zip(FILES, contents, strict=True)))
    return result


def _scored(
    kept: Kept, cases: list[Case], *, crew: Crew, shared: Path, advance: Advance
) -> Iterator[tuple[Case, dict[str, Tally]]]:
    """Each case with its scores, as it is done; who works alone hears of every slice, others of whole recordings."""

    def tell(case: Case, slices: int) -> None:
        advance(slices, facts=case.name)

    work = partial(score, kept, told=tell) if crew.is_alone else partial(score, kept)
    for case, tallies in finished(work, cases, crew=crew, shared=shared, name=attrgetter("name")):
        if not crew.is_alone:
            tell(case, len(case.rivals) * case.slices)
        yield case, tallies


def _worst(rival: Rival, sequences: list[Sequence], tallies: Mapping[tuple[str, str], Tally]) -> list[WorstCase]:
    """The worst masks of the first model."""
    return worst_cases(rival, sequences, {sequence.name: tallies[rival.name, sequence.name] for sequence in sequences})
