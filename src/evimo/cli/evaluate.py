"""`evimo evaluate`: score a model, or any program's predictions, with truth; or check a model where there is none."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from evimo.cli.progress import progress
from evimo.cli.reading import AS_TOLD, Reading
from evimo.cli.streams import console
from evimo.errors import BadInput
from evimo.evaluation.baselines import DENSITY_THRESHOLD
from evimo.evaluation.report import Report
from evimo.evaluation.tables import as_markdown, as_rich
from evimo.geometry.calibration import load_camera
from evimo.streaming import evaluating
from evimo.streaming.evaluating_predictions import WITHIN_MS, evaluate_predictions
from evimo.streaming.evaluating_without_truth import evaluate_without_truth
from evimo.writing import make_folder, save_files

WIDTH = 170


def evaluate(
    *paths: Path,
    truth: Annotated[tuple[Path, ...], Parameter(consume_multiple=True)] = (),
    model: str | None = None,
    split: str = "",
    out: Path | None = None,
    imu: Literal["auto", "off"] | None = None,
    within_ms: float | None = None,
    density_threshold: float = DENSITY_THRESHOLD,
    without_truth: bool = False,
    calibration: Path | None = None,
    reading: Reading = AS_TOLD,
) -> None:
    """Score a model on recordings with truth, or the predictions of any program, beside the trivial answers.

    evimo evaluate RECORDING... --model small
    evimo evaluate PREDICTIONS --truth RECORDING...
    evimo evaluate RECORDING... --without-truth --calibration FILE

    Args:
        paths: recordings with truth, or folders that hold them: EV-IMO and EVIMO2 in any of their layouts, and what
            `evimo simulate` or `evimo convert` makes. With --truth, the predictions: estimates.h5
            or the folder of a run, a folder of PNG masks, an npz with masks or ids and times, or labels of events as
            CSV or npz; for several recordings, a folder with one of these for each, named like it.
        truth: recordings that the predictions are of.
        model: a preset, the path of an ONNX file, or `classical`, the training-free method; small unless told
            otherwise. What a model does not estimate, such as masks by ecn, is a dash.
        split: only recordings of the test part of a published split, such as `paper2019` or `evimo2-imo`.
        out: where report.json, report.md and report.csv go; recordings scored there before with the same model and
            settings are not scored again.
        imu: off, unless told otherwise, scores events alone; auto takes the camera's rotation from the recordings'
            gyroscopes.
        within_ms: how far the time of a predicted mask may be from a slice's centre; 1 unless told otherwise.
        density_threshold: times the mean event density, for that baseline; tuned on other recordings.
        without_truth: check a model on event files of any known format: whether its flow makes the events' image
            sharper, whether its rotation is the gyroscope's, whether its masks follow its flow. Beside it stands the
            classical fit.
        calibration: of the camera, with --without-truth; else what the recordings say of themselves, or a guess.
        reading: what the recordings do not tell, with --without-truth.
    """
    if not without_truth and (calibration or reading != AS_TOLD):
        raise BadInput("recordings with truth know their camera and how to be read", fix="--without-truth, for others")
    if out is not None:
        make_folder(out)
    if split and (truth or without_truth):
        raise BadInput("--split chooses recordings with truth to run a model on", fix="leave it out")
    if without_truth:
        if truth or imu is not None or within_ms is not None:
            raise BadInput("--truth, --imu and --within-ms are for recordings with truth", fix="leave them out")
        report = _without_truth(paths, reading, model=_named(model), calibration=calibration)
    elif truth:
        if model is not None or imu is not None:
            raise BadInput("--model and --imu run a model; --truth scores predictions", fix="leave them or --truth out")
        report = _of_predictions(paths, truth, within_ms=within_ms, density_threshold=density_threshold)
    else:
        if within_ms is not None:
            raise BadInput("--within-ms is about predictions", fix="evimo evaluate PREDICTIONS --truth RECORDING...")
        report = evaluating.evaluate(
            paths,
            model=_named(model),
            out=out,
            split=split,
            imu=imu or "off",
            density_threshold=density_threshold,
            progress=progress,
        )
    _show(report, out)


def _named(model: str | None) -> str:
    return "small" if model is None else model


def _of_predictions(
    paths: tuple[Path, ...], truth: tuple[Path, ...], *, within_ms: float | None, density_threshold: float
) -> Report:
    """The report of one program's predictions."""
    if len(paths) != 1:
        raise BadInput(f"{len(paths)} predictions", fix="evimo evaluate PREDICTIONS --truth RECORDING...")
    within = WITHIN_MS if within_ms is None else within_ms
    return evaluate_predictions(
        paths[0], truth, within_ms=within, density_threshold=density_threshold, progress=progress
    )


def _without_truth(paths: tuple[Path, ...], reading: Reading, *, model: str, calibration: Path | None) -> Report:
    """The report of a model on recordings without truth."""
    recordings = [reading.opened(path) for path in paths]
    camera = None
    if calibration and recordings:
        camera = load_camera(calibration, size=recordings[0].sensor, topic=recordings[0].topic)
    return evaluate_without_truth(recordings, model=model, camera=camera, progress=progress)


def _show(report: Report, out: Path | None) -> None:
    """Print the report, and save it where that is wanted."""
    console(WIDTH).print(as_rich(report))  # narrower, they fold into letters
    if out is not None:
        contents = {"report.json": report.as_json(), "report.csv": report.as_csv(), "report.md": as_markdown(report)}
        save_files(out, contents)
        print(f"saved in {out}: report.json, report.md, report.csv")
