"""`evimo evaluate`: score a model on recordings that know the truth."""

import hashlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Literal

from rich.console import Console

from evimo import streaming
from evimo.cli.progress import progress
from evimo.errors import BadFile, NotFound
from evimo.evaluation.baselines import DENSITY_THRESHOLD
from evimo.evaluation.kinds import groups_of
from evimo.evaluation.report import Report, load_report
from evimo.evaluation.scoring import score_recording
from evimo.evaluation.tables import as_markdown, as_rich
from evimo.recordings.estimate import Estimate
from evimo.recordings.facts import own_version
from evimo.recordings.recording import Recording, knows_truth, open_recording
from evimo.streaming.models import model_of

INFO = "dataset_info.json"
WIDTH = 150


def evaluate(
    *paths: Path,
    model: str = "small",
    out: Path | None = None,
    imu: Literal["auto", "off"] = "off",
    density_threshold: float = DENSITY_THRESHOLD,
) -> None:
    """Score a model on simulated recordings, beside the trivial answers.

    Args:
        paths: recordings, folders or .npz files, or folders that hold them.
        model: a preset, or the path of an ONNX file, or `classical`, the training-free method.
        out: where report.json, report.md and report.csv go; recordings scored there before with the same model and
            settings are not scored again.
        imu: off scores events alone; auto takes the camera's rotation from the recordings' gyroscopes.
        density_threshold: times the mean event density, for that baseline; tuned on other recordings.
    """
    report = evaluated(recordings_in(paths), model=model, out=out, imu=imu, density_threshold=density_threshold)
    console = Console()
    Console(width=max(console.width, WIDTH)).print(as_rich(report))  # narrower, the tables fold into columns of letters
    if out is not None:
        report.save(out / "report.json")
        report.save_csv(out / "report.csv")
        (out / "report.md").write_text(as_markdown(report), encoding="utf-8")
        console.print(f"saved in {out}: report.json, report.md, report.csv")


def recordings_in(paths: Iterable[Path]) -> list[Path]:
    """The recordings, folders and .npz files, sorted within each path, each once.

    Raises:
        NotFound: a path holds none. BadFile: an .npz file is none.
    """
    found: dict[Path, None] = {}
    for path in paths:
        recordings = [path] if path.is_file() and knows_truth(path) else _recordings_below(path)
        if not recordings:
            raise NotFound(
                f"no recording in {str(path)!r}",
                fix=f"a folder with {INFO}, such as evimo simulate --set 1 --minutes 1 --seed 7 --out DIR makes",
            )
        found.update(dict.fromkeys(recordings))
    if not found:
        raise NotFound("no recording given", fix="evimo evaluate FOLDER, with recordings from evimo simulate")
    return list(found)


def _recordings_below(path: Path) -> list[Path]:
    """Finished ones: what is under way is hidden."""
    folders = [file.parent for file in path.rglob(INFO)]
    files = [file for file in path.rglob("*.npz") if not file.name.startswith("dataset_") and knows_truth(file)]
    shown = [each for each in folders + files if not any(part.startswith(".") for part in each.relative_to(path).parts)]
    return sorted(shown)


def evaluated(
    folders: list[Path], *, model: str, out: Path | None, density_threshold: float, imu: str = "off"
) -> Report:
    """The report of all recordings, scored one after the other; what was scored before is read from `out`."""
    settings: dict[str, str | float] = {
        "model": model,
        **{f"model {key}": value for key, value in model_of(model).identity.items()},
        "density threshold": density_threshold,
        "imu": imu,
        "evimo": own_version(),
    }
    recordings = [open_recording(folder) for folder in folders]
    kept = [kept_at(out, recording) for recording in recordings]
    reports = [scored_before(path, settings) for path in kept]
    total = Report()
    with progress(sum(len(each) for each, report in zip(recordings, reports, strict=True) if report is None)) as tick:
        for recording, path, report in zip(recordings, kept, reports, strict=True):
            if report is None:
                estimates = streaming.run(recording.events, model=model, camera=recording.camera, imu=imu)
                scored = score_recording(
                    recording,
                    ticked(estimates, tick),
                    density_threshold=density_threshold,
                    groups=groups_of(recording.meta),
                )
                report = replace(scored, settings=settings)
                if path is not None:
                    report.save(path)
            total = total + report
    return replace(total, title="simulated recordings", settings=settings)


def kept_at(out: Path | None, recording: Recording) -> Path | None:
    """Where the recording's own report is kept; the mark tells apart folders of the same name in different places."""
    if out is None:
        return None
    mark = hashlib.sha256(str(recording.path.resolve()).encode()).hexdigest()[:8]
    return out / "recordings" / f"{recording.path.name}-{mark}.json"


def ticked(estimates: Iterable[Estimate], tick: Callable[[], None]) -> Iterator[Estimate]:
    """The same estimates; `tick` is called after each was used."""
    for estimate in estimates:
        yield estimate
        tick()


def scored_before(path: Path | None, settings: dict[str, str | float]) -> Report | None:
    """The report kept at that path, if it was made with the same model and settings."""
    if path is None or not path.is_file():
        return None
    try:
        report = load_report(path)
    except BadFile:  # cut short, or of an older format: score again
        return None
    return report if report.settings == settings else None
