"""A recording and the estimates of its slices in, a report out, in constant memory."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadInput
from evimo.evaluation import baselines, ceilings
from evimo.evaluation.ceilings import residual_motion
from evimo.evaluation.kinds import familiar_objects
from evimo.evaluation.labels import LabelledSlice, labelled
from evimo.evaluation.metrics import Mask
from evimo.evaluation.protocol_scores import Protocols
from evimo.evaluation.ranked import Ranked
from evimo.evaluation.ratios import Scores
from evimo.evaluation.report import LABELS, MODEL, Report
from evimo.evaluation.scores import at_rest, event_label_scores, prediction_scores
from evimo.events.slices import SLICE_US, Slice, in_slices
from evimo.recordings.estimate import Estimate
from evimo.recordings.flow import true_flow
from evimo.recordings.prediction import Prediction, prediction_of
from evimo.recordings.recording import Recording

IdentifiedSlice = tuple[Slice, NDArray[np.uint8] | None]
NO_PREDICTION = "slices WITHOUT a prediction, not scored"
RANKED_BASELINES = (baselines.EVERYTHING, baselines.DENSITY)
"""The trivial masks that are scored under every protocol, too."""


class Labeller:
    """Finds the truth of a recording's slices."""

    def __init__(self, recording: Recording) -> None:
        """Prepare the lens map, once per recording."""
        self.recording = recording
        height, width = recording.camera.size
        pixels = np.stack(np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float)), axis=-1)
        points, self.seen = recording.camera.normalised(pixels)
        self.familiar = familiar_objects(recording.meta)
        self.grid = np.moveaxis(points, -1, 0).astype(np.float64)

    def slices(self, start_us: int) -> Iterator[IdentifiedSlice]:
        """Every slice from that time on, the unfinished last one too, and its events' own ids where they are known.

        Ids are told apart by nothing but their order, so that events are counted from the recording's start; where
        events had to be sorted or dropped, no id is known.
        """
        events, ids = self.recording.events, self.recording.event_ids
        begin_us, end_us, first = min(start_us, events.start_us), -(-events.stop_us // SLICE_US) * SLICE_US, 0
        for part in in_slices(events.packets(begin_us), start_us=begin_us, stop_us=end_us):
            last = first + len(part.events)
            orderly = not (events.faults.out_of_order or events.faults.dropped)
            if part.stop_us > start_us:
                yield part, ids[first:last] if ids is not None and orderly else None
            first = last

    def label(self, part: Slice, scored: Mask, *, event_ids: NDArray[np.uint8] | None = None) -> LabelledSlice | None:
        """The slice with its truth; None where none is known at its centre.

        scored: (H, W), pixels to score; those where the lens model does not hold are left out too.
        event_ids: the object that made each event of the slice.
        """
        recording = self.recording
        truth = recording.truth_at(part.centre_us)
        if truth is None:
            return None
        focal_px, dt_s = (recording.camera.fx, recording.camera.fy), (part.stop_us - part.start_us) * 1e-6
        flow = true_flow(truth, self.grid)
        return labelled(
            part.events,
            truth,
            scored=scored & self.seen,
            focal_px=focal_px,
            dt_s=dt_s,
            flow=flow.astype(np.float32),
            residual=residual_motion(truth, flow, self.grid, px_per_slice=(focal_px[0] * dt_s, focal_px[1] * dt_s)),
            event_ids=event_ids,
            familiar=self.familiar,
        )


def labelled_slices(recording: Recording) -> Iterator[LabelledSlice]:
    """Every slice of the recording whose truth is known, all pixels scored."""
    labeller = Labeller(recording)
    everywhere = np.ones(recording.camera.size, np.bool_)
    for part, ids in labeller.slices(recording.events.start_us):
        if (sample := labeller.label(part, everywhere, event_ids=ids)) is not None:
            yield sample


def labelled_estimates(
    recording: Recording, estimates: Iterable[Estimate]
) -> Iterator[tuple[Prediction, LabelledSlice | None]]:
    """What each estimate says, and its slice with truth; None where no truth is known at the slice's centre.

    Raises:
        BadInput: the estimates do not follow the recording's slices.
    """
    labeller = Labeller(recording)
    slices: Iterator[IdentifiedSlice] | None = None
    for estimate in estimates:
        slices = slices or labeller.slices(estimate.start_us)
        part, ids = next((each for each in slices if each[0].start_us >= estimate.start_us), (None, None))
        if part is None or part.start_us != estimate.start_us:
            raise BadInput(f"an estimate at {estimate.t_us} µs has no slice", fix="estimates of this very recording")
        yield prediction_of(estimate), labeller.label(part, estimate.valid, event_ids=ids)


def score_recording(
    recording: Recording,
    predictions: Iterable[tuple[Prediction | None, LabelledSlice | None]],
    *,
    density_threshold: float = baselines.DENSITY_THRESHOLD,
    groups: Sequence[str] = (),
) -> Report:
    """Score predictions and every trivial answer on one recording; the same slices and pixels for all of them.

    Args:
        recording: that they are of.
        predictions: of its slices in order, None where there is none, with the truth of each, None where there is none.
        density_threshold: of the event density that a baseline calls moving.
        groups: names under which the scores are reported once more, such as the kind of scene.
    """
    report = Report(counts={"recordings": 1})
    protocols = {row: Protocols() for row in (MODEL, *RANKED_BASELINES)}
    for prediction, sample in predictions:
        if sample is None:
            report = report + Report(counts={"slices without truth": 1})
        elif prediction is None:
            report = report + Report(counts={NO_PREDICTION: 1})
        else:
            report = report + slice_report(prediction, sample, protocols, density_threshold=density_threshold)
    return replace(report, groups=dict.fromkeys(groups, report.rows.get(MODEL, {})))


def slice_report(
    prediction: Prediction, sample: LabelledSlice, protocols: Mapping[str, Protocols], *, density_threshold: float
) -> Report:
    """The report of one slice; `protocols` have followed each row through the slices before.

    A slice without an event to answer from is only counted.
    """
    if not prediction.has_events:
        return Report(counts={"slices without events": 1})
    density = baselines.density_scores(sample, (*baselines.THRESHOLDS, density_threshold))
    rows = {MODEL: prediction_scores(prediction, sample), **baselines.trivial_scores(sample)}
    rows[baselines.DENSITY] = density[density_threshold]
    ranked: dict[str, Ranked] = {}
    masks = baselines.masks(sample, density_threshold)
    for row, of_row in protocols.items():
        scores, ranked[row] = of_row.of_maps(prediction if row == MODEL else masks[row], sample)
        rows[row] = rows[row] | scores
    rows = {row: rows[row] for row in (MODEL, *baselines.ROWS)} | ceilings.ceiling_scores(sample)
    if prediction.event_objects is not None:
        rows = rows_with_labels(rows, prediction.event_objects, sample)
    counts = {
        "slices": 1,
        "slices without movers": int(not sample.moving.any()),
        "slices with the camera at rest": int(at_rest(sample)),
        "movers in slices": len(sample.movers),
        "events scored": len(sample.events),
        "pixels scored": int(np.count_nonzero(sample.scored)),
        "pixels of the sensor": sample.scored.size,
    }
    return Report(
        counts=counts,
        rows=rows,
        ranked={row: each for row, each in ranked.items() if rows[row]},
        density={key: density[key] for key in baselines.THRESHOLDS},
    )


def rows_with_labels(rows: dict[str, Scores], objects: NDArray[np.int64], sample: LabelledSlice) -> dict[str, Scores]:
    """The rows with the scores of labels of events: a row of their own beside a mask, else the first one."""
    scores = event_label_scores(objects[sample.kept] > 0, sample) | Protocols().of_events(objects, sample)
    if "iou_pooled" not in rows[MODEL]:
        return {**rows, MODEL: rows[MODEL] | scores}
    return {MODEL: rows[MODEL], LABELS: scores, **{row: each for row, each in rows.items() if row != MODEL}}
