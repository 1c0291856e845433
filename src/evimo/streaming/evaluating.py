"""A model scored on recordings that know the truth, beside the trivial answers."""

import hashlib
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Literal

from evimo.arguments import number_of, path_of, paths_of
from evimo.errors import BadFile, BadInput
from evimo.evaluation.baselines import DENSITY_THRESHOLD
from evimo.evaluation.kinds import groups_of
from evimo.evaluation.labels import LabelledSlice
from evimo.evaluation.report import Report, load_report
from evimo.evaluation.scoring import labelled_estimates, score_recording
from evimo.recordings.facts import own_version
from evimo.recordings.finding import recordings_in
from evimo.recordings.prediction import Prediction
from evimo.recordings.recording import Recording, open_recording
from evimo.streaming.models import model_of
from evimo.streaming.pipeline import Run, estimates_of

Tick = Callable[[], None]
Scored = tuple[Prediction | None, LabelledSlice | None]


def unseen(total: int) -> AbstractContextManager[Tick]:
    """Show no progress."""
    return nullcontext(lambda: None)


def evaluate(
    recordings: str | Path | Sequence[str | Path],
    *,
    model: str | Path = "small",
    out: str | Path | None = None,
    split: str = "",
    imu: Literal["auto", "off"] = "off",
    density_threshold: float = DENSITY_THRESHOLD,
    progress: Callable[[int], AbstractContextManager[Tick]] = unseen,
) -> Report:
    """Score a model on recordings that know the truth, beside the trivial answers.

    Args:
        recordings: with truth, in any layout that `open_recording` opens, or folders that hold them; one or several.
        model: a preset, or the path of an ONNX file.
        out: where each recording's own report is kept, and not made again with the same model and settings.
        split: the name of a published split, of whose test part only recordings are scored.
        imu: off scores events alone; auto takes the camera's rotation from the recordings' gyroscopes.
        density_threshold: times the mean event density, for that baseline; tuned on other recordings.
        progress: takes the number of slices; inside the context that it gives, what that holds is called after each.

    Returns:
        `rows` by name, "model" first, each a mapping from a column to a score with `value`; `groups` by kind of scene.

    Raises:
        NotFound, BadFile: recordings, or the model. BadInput: `imu` is neither; another argument is not what it may be.
    """
    if imu not in ("auto", "off"):
        raise BadInput(f"no way {imu!r} to use an IMU", fix="auto or off")
    number_of(density_threshold, "density_threshold", fix="a number, as in 1.5")
    out = None if out is None else path_of(out, "out")
    opened = [open_recording(path) for path in recordings_in(paths_of(recordings, "a recording"), split=split)]
    network = model_of(model)
    settings: dict[str, str | float] = {
        "model": str(model),
        **{f"model {key}": value for key, value in network.identity.items()},
        "density threshold": density_threshold,
        "imu": imu,
        "evimo": own_version(),
    }
    kept = [_kept_at(out, recording) if out else None for recording in opened]
    told = [settings | {"recording": recording.mark} for recording in opened]
    reports = [_scored_before(path, each) for path, each in zip(kept, told, strict=True)]
    total = Report()
    with progress(sum(len(each) for each, report in zip(opened, reports, strict=True) if report is None)) as tick:
        for known, path, report, facts in zip(opened, kept, reports, told, strict=True):
            if report is None:
                recording = open_recording(known.path)  # anew: what it maps is given back when it is done
                estimates = estimates_of(Run(recording.events, network, camera=recording.camera, imu=imu))
                slices = _ticked(labelled_estimates(recording, estimates), tick)
                groups = groups_of(recording.meta)
                scored = score_recording(recording, slices, density_threshold=density_threshold, groups=groups)
                report = replace(scored, settings=facts)
                if path is not None:
                    report.save(path)
            total = total + report
    return replace(total, title="recordings", settings=settings)


def _kept_at(out: Path, recording: Recording) -> Path:
    """Where the recording's own report is kept; the mark tells apart folders of the same name in different places."""
    mark = hashlib.sha256(os.fsencode(recording.path.resolve())).hexdigest()[:8]
    return out / "recordings" / f"{recording.path.name}-{mark}.json"


def _ticked(slices: Iterable[Scored], tick: Tick) -> Iterator[Scored]:
    """The same slices; `tick` is called after each was used."""
    for each in slices:
        yield each
        tick()


def _scored_before(path: Path | None, settings: dict[str, str | float]) -> Report | None:
    """The report kept at that path, if it was made of the same recording with the same model and settings."""
    if path is None or not path.is_file():
        return None
    try:
        report = load_report(path)
    except BadFile:  # cut short, or of an older format: score again
        return None
    return report if report.settings == settings else None
