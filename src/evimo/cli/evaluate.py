"""`evimo evaluate`: score a model on recordings that know the truth."""

import hashlib
import importlib.metadata
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeRemainingColumn

from evimo import streaming
from evimo.errors import BadFile, NotFound
from evimo.evaluation.baselines import DENSITY_THRESHOLD
from evimo.evaluation.report import Report, load_report
from evimo.evaluation.scoring import score_recording
from evimo.evaluation.tables import as_markdown, as_rich
from evimo.events.slices import SLICE_US
from evimo.recordings.estimate import Estimate
from evimo.recordings.recording import Recording, open_recording
from evimo.streaming.inference import Network

INFO = "dataset_info.json"
SIMULATED = "sim"  # key of a recording's meta that only our simulator writes
WIDTH = 150


def evaluate(
    *paths: Path, model: str = "tiny", out: Path | None = None, density_threshold: float = DENSITY_THRESHOLD
) -> None:
    """Score a model on simulated recordings, beside the trivial answers.

    Args:
        paths: folders of recordings, or folders that hold such folders.
        model: tiny, or the path of an ONNX file.
        out: where report.json, report.md and report.csv go; recordings scored there before with the same model and
            settings are not scored again.
        density_threshold: times the mean event density, for that baseline; tuned on other recordings.
    """
    report = evaluated(recordings_in(paths), model=model, out=out, density_threshold=density_threshold)
    console = Console()
    Console(width=max(console.width, WIDTH)).print(as_rich(report))  # narrower, the tables fold into columns of letters
    if out is not None:
        report.save(out / "report.json")
        report.save_csv(out / "report.csv")
        (out / "report.md").write_text(as_markdown(report), encoding="utf-8")
        console.print(f"saved in {out}: report.json, report.md, report.csv")


def recordings_in(paths: Iterable[Path]) -> list[Path]:
    """The recordings' folders, sorted within each path, each once.

    Raises:
        NotFound: a path holds none.
    """
    found: dict[Path, None] = {}
    for path in paths:
        folders = [file.parent for file in sorted(path.rglob(INFO))]
        if not folders:
            raise NotFound(
                f"no recording in {str(path)!r}",
                fix=f"a folder with {INFO}, such as evimo simulate --set 1 --minutes 1 --seed 7 --out DIR makes",
            )
        found.update(dict.fromkeys(folders))
    if not found:
        raise NotFound("no recording given", fix="evimo evaluate FOLDER, with recordings from evimo simulate")
    return list(found)


def evaluated(folders: list[Path], *, model: str, out: Path | None, density_threshold: float) -> Report:
    """The report of all recordings, scored one after the other; what was scored before is read from `out`."""
    settings: dict[str, str | float] = {
        "model": model,
        "model sha256": Network(model).sha256,
        "density threshold": density_threshold,
        "evimo": importlib.metadata.version("evimo"),
    }
    recordings = [open_recording(folder) for folder in folders]
    title = "simulated recordings" if all(SIMULATED in each.meta for each in recordings) else "recordings"
    total = Report()
    with progress() as bar:
        task = bar.add_task("", total=sum(map(slice_count, recordings)))
        for recording in recordings:
            bar.update(task, description=recording.path.name)
            kept = None if out is None else out / "recordings" / f"{recording.path.name}-{mark(recording.path)}.json"
            report = scored_before(kept, settings)
            if report is None:
                estimates = streaming.run(recording.events, model=model, camera=recording.camera)
                ticking = ticked(estimates, lambda: bar.advance(task))
                scored = score_recording(recording, ticking, density_threshold=density_threshold)
                report = replace(scored, settings=settings)
                if kept is not None:
                    report.save(kept)
            else:
                bar.update(task, total=(bar.tasks[0].total or 0) - slice_count(recording))
            total = total + report
    return replace(total, title=title, settings=settings)


def progress() -> Progress:
    """A bar with slices done, slices/s and time left, on stderr."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("slices, left"))
    return Progress(SpinnerColumn(), *columns, TimeRemainingColumn(), console=Console(stderr=True))


def slice_count(recording: Recording) -> int:
    """About how many estimates the recording will give."""
    return (recording.events.stop_us - 1) // SLICE_US - recording.events.start_us // SLICE_US


def ticked(estimates: Iterable[Estimate], tick: Callable[[], None]) -> Iterator[Estimate]:
    """The same estimates; `tick` is called after each was used."""
    for estimate in estimates:
        yield estimate
        tick()


def mark(folder: Path) -> str:
    """Tells apart folders of the same name in different places."""
    return hashlib.sha256(str(folder.resolve()).encode()).hexdigest()[:8]


def scored_before(path: Path | None, settings: dict[str, str | float]) -> Report | None:
    """The report kept at that path, if it was made with the same model and settings."""
    if path is None or not path.is_file():
        return None
    try:
        report = load_report(path)
    except BadFile:  # cut short, or of an older format: score again
        return None
    return report if report.settings == settings else None
