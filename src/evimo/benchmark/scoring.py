"""One model, or all trivial answers, scored on one recording in constant memory."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from evimo.benchmark.curves import curves_of, mask_curves
from evimo.benchmark.tally import FrameScore, Tally
from evimo.evaluation import baselines, ceilings
from evimo.evaluation.labels import SMALL_AREA_PX, LabelledSlice
from evimo.evaluation.metrics import overlap
from evimo.evaluation.ratios import Scores
from evimo.evaluation.report import MODEL
from evimo.evaluation.scores import at_rest, prediction_scores
from evimo.evaluation.scoring import Labeller, labelled_estimates
from evimo.geometry.rectification import rectified
from evimo.recordings.prediction import Prediction
from evimo.recordings.recording import Recording
from evimo.streaming.pipeline import run
from evimo.streaming.span import span_of

TRIVIAL = "trivial answers"
"""In the place of a model's name."""
Tick = Callable[[], None]


def model_tally(recording: Recording, model: str | Path, tick: Tick) -> Tally:
    """Score a model on every slice of a recording whose truth is known; `tick` is called after each."""
    estimates = run(recording.events, model=model, camera=recording.camera, imu="off")
    total = Tally(counts={"recordings": 1})
    for prediction, sample in labelled_estimates(recording, estimates):
        total = total + _of_slice(prediction, sample)
        tick()
    return total


def _of_slice(prediction: Prediction, sample: LabelledSlice | None) -> Tally:
    if sample is None:
        return Tally(counts={"slices without truth": 1})
    if not prediction.has_events:
        return Tally(counts={"slices without events": 1})
    frames: list[FrameScore] = []
    if prediction.moving is not None:
        true, called = sample.moving & sample.scored, prediction.moving & sample.scored
        cut, union = overlap(called, true)
        if np.count_nonzero(true) >= SMALL_AREA_PX:
            start_us = sample.truth.t_us - round(sample.dt_s * 5e5)
            frames.append(FrameScore(start_us, cut / union, union - cut))
    return Tally(
        rows={MODEL: prediction_scores(prediction, sample)},
        curves=curves_of(prediction, sample),
        counts=counts_of(sample),
        frames=frames,
    )


def trivial_tally(recording: Recording, tick: Tick) -> Tally:
    """Score the trivial answers and the ceilings on the very slices and pixels on which models are scored."""
    labeller, valid, span = Labeller(recording), rectified(recording.camera).valid, span_of(recording.events)
    total = Tally(counts={"recordings": 1})
    for part, _ in labeller.slices(recording.events.start_us):
        if not span.first <= part.index < span.last:
            continue
        sample = labeller.label(part, valid)
        if sample is None:
            total = total + Tally(counts={"slices without truth": 1})
        elif not len(part.events):
            total = total + Tally(counts={"slices without events": 1})
        else:
            total = total + Tally(
                rows=dict(_trivial_rows(sample)), curves=_trivial_curves(sample), counts=counts_of(sample)
            )
        tick()
    return total


def _trivial_rows(sample: LabelledSlice) -> Iterator[tuple[str, Scores]]:
    density = baselines.density_scores(sample, (baselines.DENSITY_THRESHOLD,))
    yield from baselines.trivial_scores(sample).items()
    yield baselines.DENSITY, density[baselines.DENSITY_THRESHOLD]
    yield from ceilings.ceiling_scores(sample).items()


def _trivial_curves(sample: LabelledSlice) -> dict[str, Scores]:
    """Each under its row's name and the curve's."""
    dense = baselines.masks(sample, baselines.DENSITY_THRESHOLD)[baselines.DENSITY]
    assert dense.probability is not None
    constant = Prediction(rel_depth=np.ones(sample.scored.shape), ego=np.zeros(6))
    rows = {
        baselines.DENSITY: mask_curves(dense.probability, sample),
        baselines.ZERO_TWIST: curves_of(constant, sample),
    }
    return {f"{row}: {name}": scores for row, curves in rows.items() for name, scores in curves.items()}


def counts_of(sample: LabelledSlice) -> dict[str, int]:
    """What is scored in one slice."""
    return {
        "slices": 1,
        "slices with movers": int((sample.moving & sample.scored).any()),
        "slices with the camera at rest": int(at_rest(sample)),
        "movers in slices": len(sample.movers),
        "events scored": len(sample.events),
        "pixels scored": int(np.count_nonzero(sample.scored)),
        "pixels of the sensor": sample.scored.size,
    }
