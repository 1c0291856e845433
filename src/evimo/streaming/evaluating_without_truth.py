"""A model checked on recordings of which nobody knows the truth, beside the classical fit and no motion at all."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

import numpy as np

from evimo.errors import BadInput
from evimo.evaluation import baselines
from evimo.evaluation.ratios import Scores
from evimo.evaluation.report import MODEL, Report
from evimo.evaluation.without_truth import Agreement, add_slice, rotation_scores, without_flow
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

    The gyroscope, where there is one, is kept for the check: estimates are made from events alone. All rows are of the
    same slices, and of one alignment of the gyroscope, that to the checked model.

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
            rows, facts[f"gyroscope of {events.path.name}"] = _checked(each, tick)
            rows[baselines.ZERO_FLOW] = without_flow(rows[MODEL])
            counts = {"recordings": 1, "slices": len(each[MODEL].span)}
            total = total + Report(rows=rows, groups={events.path.name: rows[MODEL]}, counts=counts)
    settings: dict[str, str | float] = {"model": str(model)}
    settings |= {f"model {key}": value for key, value in models[MODEL].identity.items()}
    return replace(total, title="recordings without truth", settings=settings | facts | {"evimo": own_version()})


def _checked(runs: Mapping[str, Run], tick: Tick) -> tuple[dict[str, Scores], str]:
    """What each model's estimates of one recording agree with, slice by slice, and what was found of its gyroscope."""
    agreements = {row: Agreement(run.rectification) for row, run in runs.items()}
    for found in zip(*(run.slices() for run in runs.values()), strict=True):
        add_slice(list(agreements.values()), [estimate for estimate, _ in found], found[0][1])
        for _ in found:
            tick()
    times_us = np.array(agreements[MODEL].times_us, np.int64)
    rotations = {row: np.array(each.rotations, np.float64).reshape(-1, 3) for row, each in agreements.items()}
    rotation = rotation_of(runs[MODEL].events, lambda: (agreements[MODEL].times_us, rotations[MODEL]))
    rows = {row: each.scores for row, each in agreements.items()}
    if rotation.gyroscope is None or not len(times_us):
        return rows, rotation.said
    half = SLICE_US // 2
    measured, known = rotation.gyroscope.mean_rates(times_us - half, times_us + half)
    if known.any():
        for row, said in rotations.items():
            rows[row] |= rotation_scores(said[known], measured[known], dt_s=SLICE_US * 1e-6)
    return rows, rotation.said
