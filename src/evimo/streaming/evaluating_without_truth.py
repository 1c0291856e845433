"""A model checked on recordings of which nobody knows the truth, beside the classical fit and no motion at all."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

import numpy as np

from evimo.errors import BadInput
from evimo.evaluation import baselines
from evimo.evaluation.ratios import Scores
from evimo.evaluation.report import MODEL, Report
from evimo.evaluation.without_truth import Agreement, rotation_scores, without_flow
from evimo.events.slices import SLICE_US
from evimo.formats.event_file import EventFile
from evimo.geometry.camera import Camera
from evimo.recordings.facts import own_version
from evimo.streaming.evaluating import Tick, unseen
from evimo.streaming.four_parameters import CLASSICAL
from evimo.streaming.models import Model, model_of
from evimo.streaming.pipeline import Run
from evimo.streaming.rotation import rotation_of


def evaluate_without_truth(
    recordings: Sequence[EventFile],
    *,
    model: str | Path = "small",
    camera: Camera | None = None,
    progress: Callable[[int], AbstractContextManager[Tick]] = unseen,
) -> Report:
    """Check a model on recordings without truth: what its estimates agree with (docs/metrics.md, "Without truth").

    The gyroscope, where there is one, is kept for the check: estimates are made from events alone.

    Args:
        recordings: from `open_events`.
        model: a preset, the path of an ONNX file, or `classical`.
        camera: of all of them; without it what each says of itself, else a guess (with a warning).
        progress: takes the number of slices; inside the context that it gives, what that holds is called after each.

    Raises:
        NotFound, BadFile: the model. BadInput: no recording, one without a complete slice, or a camera of another size.
    """
    if not recordings:
        raise BadInput("no recording", fix="evimo evaluate RECORDING... --without-truth")
    models: dict[str, Model] = {MODEL: model_of(model)}
    if str(model) != CLASSICAL:
        models[CLASSICAL] = model_of(CLASSICAL)
    runs = [
        {row: Run(each, network, camera=camera, imu="off") for row, network in models.items()} for each in recordings
    ]
    total, facts = Report(), dict[str, str | float]()
    with progress(sum(len(run.span) for each in runs for run in each.values())) as tick:
        for events, each in zip(recordings, runs, strict=True):
            rows: dict[str, Scores] = {}
            for row, run in each.items():
                rows[row], said = _checked(run, tick)
                facts[f"gyroscope of {events.path.name}, by {row}"] = said
            gains = [scores["warp_gain"] for scores in rows.values() if "warp_gain" in scores]
            rows[baselines.ZERO_FLOW] = without_flow(gains)
            counts = {"recordings": 1, "slices": len(each[MODEL].span)}
            total = total + Report(rows=rows, groups={events.path.name: rows[MODEL]}, counts=counts)
    settings: dict[str, str | float] = {"model": str(model)}
    settings |= {f"model {key}": value for key, value in models[MODEL].identity.items()}
    return replace(total, title="recordings without truth", settings=settings | facts | {"evimo": own_version()})


def _checked(run: Run, tick: Tick) -> tuple[Scores, str]:
    """What one model's estimates of one recording agree with, and what was found of its gyroscope."""
    agreement = Agreement(run.rectification)
    for estimate, events in run.slices():
        agreement.add(estimate, events)
        tick()
    times_us = np.array(agreement.times_us, np.int64)
    rotations = np.array(agreement.rotations, np.float64).reshape(-1, 3)
    rotation = rotation_of(run.events, lambda: (agreement.times_us, rotations))
    if rotation.gyroscope is None or not len(times_us):
        return agreement.scores, rotation.said
    half = SLICE_US // 2
    measured, known = rotation.gyroscope.mean_rates(times_us - half, times_us + half)
    scores = rotation_scores(rotations[known], measured[known], dt_s=SLICE_US * 1e-6) if known.any() else {}
    return agreement.scores | scores, rotation.said
