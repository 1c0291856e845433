"""Any program's predictions scored on recordings that know the truth, under every published protocol."""

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

import numpy as np

from evimo.arguments import path_of, paths_of
from evimo.errors import BadInput, EvimoWarning
from evimo.evaluation.baselines import DENSITY_THRESHOLD
from evimo.evaluation.kinds import groups_of
from evimo.evaluation.labels import LabelledSlice
from evimo.evaluation.report import Report
from evimo.evaluation.scoring import NO_PREDICTION, Labeller, score_recording
from evimo.events.slices import Slice
from evimo.predictions.opening import open_predictions, predictions_of
from evimo.predictions.sources import Maps, Predictions
from evimo.recordings.facts import own_version
from evimo.recordings.finding import recordings_in
from evimo.recordings.prediction import Prediction
from evimo.recordings.recording import SAME_US, Recording, open_recording
from evimo.streaming.evaluating import Tick, unseen
from evimo.writing import in_utf8

WITHIN_MS = SAME_US / 1000
UNUSED = "predictions at no slice's centre, not scored"
UNLABELLED = "events without a label, taken as static"


def evaluate_predictions(
    predictions: str | Path,
    truth: str | Path | Sequence[str | Path],
    *,
    within_ms: float = WITHIN_MS,
    density_threshold: float = DENSITY_THRESHOLD,
    progress: Callable[[int], AbstractContextManager[Tick]] = unseen,
) -> Report:
    """Score what a program says of recordings that know the truth, under each published protocol, beside trivial masks.

    Args:
        predictions: `estimates.h5` or the folder of a run, a folder of PNG masks, an .npz file with masks or ids and
            times, or labels of events as CSV or .npz; for several recordings a folder that holds one of these for each,
            named like it.
        truth: the recordings, made by `evimo simulate`, or folders that hold them.
        within_ms: how far the time of a mask may be from a slice's centre, of which the truth is known.
        density_threshold: times the mean event density, for that baseline; tuned on other recordings.
        progress: takes the number of slices; inside the context that it gives, what that holds is called after each.

    Raises:
        NotFound, BadFile: predictions or recordings. BadInput: predictions of another recording or sensor, or at times
            that fit no slice.
    """
    if not 0 <= within_ms <= 12.5:
        raise BadInput(f"masks within {within_ms:g} ms of a slice's centre", fix="0 to 12.5, half of a slice")
    recordings = recordings_in(paths_of(truth, "a recording"))
    paths, within_us = predictions_of(path_of(predictions, "predictions"), recordings), round(within_ms * 1e3)
    opened = [open_recording(path) for path in recordings]
    total, facts = Report(), list[dict[str, str]]()
    with progress(sum(map(len, opened))) as tick:
        for recording, path in zip(opened, paths, strict=True):
            report, told = _scored(recording, path, within_us=within_us, threshold=density_threshold, tick=tick)
            total = total + report
            facts.append(told)
    settings: dict[str, str | float] = {"predictions": str(predictions), **_merged(facts)}
    settings |= {"masks within ms": within_ms, "density threshold": density_threshold, "evimo": own_version()}
    return replace(total, title="predictions", settings=settings)


def _scored(
    recording: Recording, path: Path, *, within_us: int, threshold: float, tick: Tick
) -> tuple[Report, dict[str, str]]:
    """The report of one recording, and what its predictions tell of themselves."""
    predictions = open_predictions(path, recording)
    of = predictions.facts.get("recording", recording.path.name)
    if in_utf8(of) != in_utf8(recording.path.name):
        text = f"{path} says that it is of {of!r}; it is scored against {recording.path}"
        warnings.warn(text, EvimoWarning, stacklevel=3)
    matched = _Matched(recording, predictions, within_us=within_us)
    report = score_recording(
        recording, matched.slices(tick), density_threshold=threshold, groups=groups_of(recording.meta)
    )
    if not report.counts.get("slices"):
        raise BadInput(
            f"no slice of {recording.path} has both truth and a prediction in {path}",
            fix="predictions of this very recording, one for each slice of 25 ms",
        )
    counts = {NO_PREDICTION: 0, **report.counts, **matched.counts()}
    told = {"kind": predictions.kind}
    told |= {name.replace("_", " "): text for name, text in predictions.facts.items() if name != "recording"}
    return replace(report, counts=counts), told


class _Matched:
    """Predictions and truth of the slices of one recording."""

    def __init__(self, recording: Recording, predictions: Predictions, *, within_us: int) -> None:
        self._recording, self._predictions, self._within_us = recording, predictions, within_us
        self._used = set[int]()
        if predictions.maps is not None:
            self._check_times(predictions.maps)

    def slices(self, tick: Tick) -> Iterator[tuple[Prediction | None, LabelledSlice | None]]:
        """Each slice of the recording, in order."""
        labeller = Labeller(self._recording)
        everywhere = np.ones(self._recording.camera.size, np.bool_)
        labels = self._predictions.labels
        for part, ids in labeller.slices(self._recording.events.start_us):
            prediction = self._at(part)
            scored = everywhere if prediction is None or prediction.valid is None else prediction.valid
            sample = labeller.label(part, scored, event_ids=ids)
            yield prediction, sample
            if sample is not None:
                tick()
        if labels is not None:
            labels.finish()

    def counts(self) -> dict[str, int]:
        """What of the predictions was not used, after the last slice."""
        maps, labels = self._predictions.maps, self._predictions.labels
        counts = {} if maps is None else {UNUSED: len(maps.times_us) - len(self._used)}
        return counts if labels is None else counts | {UNLABELLED: labels.unlabelled}

    def _at(self, part: Slice) -> Prediction | None:
        """What is said of a slice; None where nothing is."""
        maps, labels = self._predictions.maps, self._predictions.labels
        objects = None if labels is None else labels.of(part)
        k = None if maps is None else _nearest(maps, part.centre_us, self._within_us)
        if maps is None or k is None:
            return None if maps is not None or objects is None else Prediction(event_objects=objects)
        self._used.add(k)
        return replace(maps.at(k), event_objects=objects)

    def _check_times(self, maps: Maps) -> None:
        """Refuse maps of which none is near the centre of a slice.

        Raises:
            BadInput: that is so.
        """
        times_us = self._recording.times_us
        if any(_nearest(maps, int(t_us), self._within_us) is not None for t_us in times_us):
            return
        apart_us = min((int(np.abs(maps.times_us - t_us).min()) for t_us in times_us), default=0)
        raise BadInput(
            f"no mask in {self._predictions.path} is within {self._within_us / 1e3:g} ms of the centre of a slice:"
            f" masks are at {maps.times_us[0]} to {maps.times_us[-1]} µs, the truth at {times_us[0]} to"
            f" {times_us[-1]} µs, {apart_us} µs apart at least",
            fix="times in µs of the recording's own clock, one for each slice of 25 ms at its centre;"
            " --within-ms allows up to 12.5",
        )


def _nearest(maps: Maps, centre_us: int, within_us: int) -> int | None:
    """The map nearest to that instant; None where none is near."""
    at = int(np.searchsorted(maps.times_us, centre_us))
    near = range(max(0, at - 1), min(len(maps.times_us), at + 1))
    best = min(near, key=lambda k: abs(int(maps.times_us[k]) - centre_us))
    return best if abs(int(maps.times_us[best]) - centre_us) <= within_us else None


def _merged(facts: Sequence[dict[str, str]]) -> dict[str, str]:
    """What the predictions of several recordings tell, each different text once."""
    names = dict.fromkeys(name for told in facts for name in told)
    return {name: ", ".join(dict.fromkeys(told[name] for told in facts if name in told)) for name in names}
