"""Models and trivial answers scored on one recording, in constant memory."""

from collections.abc import Callable, Iterator, Mapping

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
from evimo.recordings.prediction import Prediction, prediction_of
from evimo.recordings.recording import Recording
from evimo.streaming.pipeline import run
from evimo.streaming.span import span_of

TRIVIAL = "trivial answers"
"""In the place of a model's name."""
Tick = Callable[[], None]


def tallies_of(recording: Recording, models: Mapping[str, str], tick: Tick) -> dict[str, Tally]:
    """Score models on every slice of a recording whose truth is known, all of them side by side.

    The truth of a slice is prepared once, which takes longer than scoring one of them.

    Args:
        recording: with truth.
        models: by name; of the name `TRIVIAL` all trivial answers and the ceilings.
        tick: called after each slice.
    """
    totals = {name: Tally(counts={"recordings": 1}) for name in models}
    networks = {name: model for name, model in models.items() if name != TRIVIAL}
    for said, sample in _predicted(recording, networks) if networks else _unpredicted(recording):
        for name in models:
            totals[name] = totals[name] + _of_slice(said.get(name), sample)
        tick()
    return totals


Predicted = tuple[dict[str, Prediction], LabelledSlice | None]
"""What each model says of a slice, and its truth; no truth where none is known, or where the slice has no events."""


def _predicted(recording: Recording, models: Mapping[str, str]) -> Iterator[Predicted]:
    runs = [run(recording.events, model=model, camera=recording.camera, imu="off") for model in models.values()]
    for (first, sample), *others in zip(labelled_estimates(recording, runs[0]), *runs[1:], strict=True):
        said = dict(zip(models, (first, *map(prediction_of, others)), strict=True))
        yield said, sample if first.has_events else None


def _unpredicted(recording: Recording) -> Iterator[Predicted]:
    """The very slices and pixels of which models would say something."""
    labeller, valid, span = Labeller(recording), rectified(recording.camera).valid, span_of(recording.events)
    for part, _ in labeller.slices(recording.events.start_us):
        if span.first <= part.index < span.last:
            yield {}, labeller.label(part, valid) if len(part.events) else None


def _of_slice(prediction: Prediction | None, sample: LabelledSlice | None) -> Tally:
    """The scores of one slice; of the trivial answers where there is no prediction."""
    if sample is None:
        return Tally(counts={"slices without events or truth": 1})
    if prediction is None:
        return Tally(rows=dict(_trivial_rows(sample)), curves=_trivial_curves(sample), counts=counts_of(sample))
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
