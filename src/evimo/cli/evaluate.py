"""`evimo evaluate`: score a model on recordings that know the truth."""

from pathlib import Path
from typing import Literal

from rich.console import Console

from evimo.cli.progress import progress
from evimo.evaluation.baselines import DENSITY_THRESHOLD
from evimo.evaluation.tables import as_markdown, as_rich
from evimo.streaming import evaluating
from evimo.writing import make_folder, save_files

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
    if out is not None:
        make_folder(out)
    report = evaluating.evaluate(
        paths, model=model, out=out, imu=imu, density_threshold=density_threshold, progress=progress
    )
    Console(width=max(Console().width, WIDTH)).print(as_rich(report))  # narrower, they fold into letters
    if out is not None:
        contents = {"report.json": report.as_json(), "report.csv": report.as_csv(), "report.md": as_markdown(report)}
        save_files(out, contents)
        print(f"saved in {out}: report.json, report.md, report.csv")
