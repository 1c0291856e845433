"""A recording and the estimates of its slices in, a report out, in constant memory."""

from collections.abc import Iterable, Iterator

import numpy as np

from evimo.errors import BadInput
from evimo.evaluation import baselines
from evimo.evaluation.labels import LabelledSlice, labelled
from evimo.evaluation.report import MODEL, Report
from evimo.evaluation.scores import estimate_scores
from evimo.events.slices import SLICE_US, Slice, in_slices
from evimo.recordings.estimate import Estimate
from evimo.recordings.recording import Recording

MATCH_US = 1_000
"""Truth further than this from the slice's centre is not the truth of that slice."""


def labelled_estimates(
    recording: Recording, estimates: Iterable[Estimate]
) -> Iterator[tuple[Estimate, LabelledSlice | None]]:
    """Each estimate with its slice's events and truth; None where the recording knows no truth at the slice's centre.

    Raises:
        BadInput: the estimates do not follow the recording's slices.
    """
    slices: Iterator[Slice] | None = None
    camera = recording.camera
    for estimate in estimates:
        slices = slices or slices_from(recording, estimate.start_us)
        part = next((each for each in slices if each.start_us >= estimate.start_us), None)
        if part is None or part.start_us != estimate.start_us:
            raise BadInput(f"an estimate at {estimate.t_us} µs has no slice", fix="estimates of this very recording")
        k = int(np.argmin(np.abs(recording.times_us - estimate.t_us)))
        if abs(int(recording.times_us[k]) - estimate.t_us) > MATCH_US:
            yield estimate, None
            continue
        truth = recording.truth(k)
        yield (
            estimate,
            labelled(
                part.events,
                truth,
                scored=estimate.valid,
                focal_px=(camera.fx, camera.fy),
                dt_s=(estimate.stop_us - estimate.start_us) * 1e-6,
                flow=recording.flow(k),
            ),
        )


def slices_from(recording: Recording, start_us: int) -> Iterator[Slice]:
    """Every slice from that time on, the unfinished last one too."""
    stop_us = recording.events.stop_us + SLICE_US
    return in_slices(recording.events.packets(start_us=start_us), start_us=start_us, stop_us=stop_us)


def score_recording(
    recording: Recording, estimates: Iterable[Estimate], *, density_threshold: float = baselines.DENSITY_THRESHOLD
) -> Report:
    """Score the model and every trivial answer on one recording; the same slices and pixels for all of them."""
    report = Report(counts={"recordings": 1})
    for estimate, sample in labelled_estimates(recording, estimates):
        report = report + slice_report(estimate, sample, density_threshold=density_threshold)
    return report


def slice_report(estimate: Estimate, sample: LabelledSlice | None, *, density_threshold: float) -> Report:
    """The report of one slice; one without truth is only counted."""
    if sample is None:
        return Report(counts={"slices without truth": 1})
    density = baselines.density_scores(sample, (*baselines.THRESHOLDS, density_threshold))
    rows = {MODEL: estimate_scores(estimate, sample), **baselines.trivial_scores(sample)}
    rows[baselines.DENSITY] = density[density_threshold]
    counts = {
        "slices": 1,
        "slices without movers": int(not sample.moving.any()),
        "events": len(sample.events),
        "pixels scored": int(np.count_nonzero(sample.scored)),
        "pixels of the sensor": sample.scored.size,
    }
    return Report(counts=counts, rows=rows, density={key: density[key] for key in baselines.THRESHOLDS})
