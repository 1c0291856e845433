"""What is kept of each model on each recording, so that a benchmark that was killed goes on where it was."""

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evimo.benchmark.scenes import background_of
from evimo.benchmark.scoring import TRIVIAL, tallies_of
from evimo.benchmark.tally import Tally, tally_from
from evimo.errors import BadInput
from evimo.evaluation.baselines import DENSITY_THRESHOLD
from evimo.recordings.facts import own_version
from evimo.recordings.finding import recordings_in
from evimo.recordings.recording import Recording, open_recording
from evimo.streaming.models import model_of
from evimo.writing import save_text

FORMAT = 2
"""Of the kept files; grows when the meaning of a number changes."""
MARK = 10  # digits of a recording's mark in a file's name


@dataclass(frozen=True)
class Sequence:
    """One recording. name: as plots and files call it. scene: one of `scenes.SCENES`, or `other`."""

    recording: Recording
    name: str
    scene: str


@dataclass(frozen=True)
class Rival:
    """A model, or all trivial answers. name: as tables call it. identity: what its numbers depend on."""

    name: str
    model: str
    identity: dict[str, str]


def sequences_in(folder: Path) -> list[Sequence]:
    """The recordings with truth in a folder.

    Raises:
        NotFound, BadFile: there are none, or one is damaged.
    """
    found: list[Sequence] = []
    for path in recordings_in([folder]):
        recording = open_recording(path)
        name = path.relative_to(folder).as_posix() if path != folder else path.name
        found.append(Sequence(recording, name, background_of(path, recording.meta, below=folder)))
    return found


def rivals_of(models: tuple[str, ...]) -> list[Rival]:
    """The models by name, and the trivial answers.

    Raises:
        NotFound, BadFile: as `model_of`. BadInput: there is none, or two have one name.
    """
    if not models:
        raise BadInput("no model", fix="--models base tiny classical")
    rivals = [Rival(Path(model).stem, model, dict(model_of(model).identity)) for model in models]
    names = [rival.name for rival in rivals]
    if twice := sorted({name for name in names if names.count(name) > 1} | ({TRIVIAL} & set(names))):
        raise BadInput(f"two models are called {twice[0]!r}", fix="other names of their files")
    return [*rivals, Rival(TRIVIAL, "", {"density threshold": f"{DENSITY_THRESHOLD:g}"})]


class Kept:
    """The kept files of a folder: one for each model and recording."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def known(self, rival: Rival, sequence: Sequence) -> Tally | None:
        """What was kept, if it is of this very model, recording and version; None otherwise."""
        try:
            saved = json.loads(self._path(rival, sequence).read_text(encoding="utf-8"))
            return tally_from(saved["tally"]) if saved["of"] == _settings(rival, sequence) else None
        except (OSError, ValueError, KeyError, TypeError, AttributeError):  # missing, cut short, or of another format
            return None

    def keep(self, rival: Rival, sequence: Sequence, tally: Tally) -> None:
        """Keep it for next time."""
        content = {"of": _settings(rival, sequence), "tally": tally.as_dict()}
        save_text(json.dumps(content, ensure_ascii=False) + "\n", self._path(rival, sequence))

    def _path(self, rival: Rival, sequence: Sequence) -> Path:
        name = sequence.name.removesuffix(".npz").replace("/", "_")
        return self._folder / rival.name.replace(" ", "_") / f"{name}-{sequence.recording.mark[:MARK]}.json"


def _settings(rival: Rival, sequence: Sequence) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "model": rival.name,
        "identity": rival.identity,
        "recording": sequence.recording.mark,
        "evimo": own_version(),
    }


@dataclass(frozen=True)
class Case:
    """A recording by its path, and models that are not scored on it yet: a job for any process that sees the files."""

    path: Path
    name: str
    scene: str
    slices: int
    rivals: tuple[Rival, ...]


def case_of(sequence: Sequence, rivals: Iterable[Rival]) -> Case:
    """These models on that recording."""
    recording = sequence.recording
    return Case(recording.path, sequence.name, sequence.scene, len(recording), tuple(rivals))


def score(
    kept: Kept, case: Case, told: Callable[[Case, int], None] = lambda case, slices: None
) -> tuple[Case, dict[str, Tally]]:
    """Score the models of a case side by side and keep what comes of it.

    Args:
        kept: where.
        case: what.
        told: of the case, and of how many slices more of it are scored, one for each model.

    Returns:
        The case and what each model has, by name.
    """
    recording = open_recording(case.path)  # anew: what it maps is given back when it is done
    sequence = Sequence(recording, case.name, case.scene)
    known = {rival.name: kept.known(rival, sequence) for rival in case.rivals}  # of a process that died after it
    tallies = {name: tally for name, tally in known.items() if tally is not None}
    missing = [rival for rival in case.rivals if rival.name not in tallies]
    models = {rival.name: rival.model for rival in missing}
    if models:
        tallies |= tallies_of(recording, models, lambda: told(case, len(models)))
    for rival in missing:
        kept.keep(rival, sequence, tallies[rival.name])
    return case, tallies
