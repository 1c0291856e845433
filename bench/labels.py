"""Event IoU of masks and of labels of events on simulated recordings, whose events know their objects.

    python bench/labels.py RECORDING... [--model tiny | --true]

An event moves if its pixel saw an object that moves at the slice's centre. `label_rows` says what 20,000 events cost,
for `python bench/speed.py --only labels`.
"""

import argparse
import statistics
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from evimo import streaming
from evimo.evaluation.circles import added_rows, event_scores
from evimo.evaluation.scores import Scores
from evimo.evaluation.scoring import Labeller
from evimo.events.events import Events, joined
from evimo.events.slices import SLICE_US
from evimo.formats import open_events
from evimo.geometry.rectification import Rectification, rectified
from evimo.recordings.estimate import Estimate
from evimo.recordings.flow import true_flow
from evimo.recordings.recording import Recording, open_recording
from evimo.recordings.truth import Truth
from evimo.streaming.event_labels import EventLabeller
from evimo.streaming.inference import Network
from evimo.streaming.objects import measured
from evimo.streaming.pipeline import Run

EVENTS = 20_000
ROUNDS = 5
WAYS = "mask at the event's pixel", "mask where the event was", "label of the event"


def recording_scores(path: Path, model: str | None) -> dict[str, Scores]:
    """Scores of three ways to label the events of a recording, over the slices whose truth is known.

    model: None starts from true masks, flow, depth and motion.
    """
    recording = open_recording(path)
    ids, whole = recording.event_ids, joined(list(recording.events))
    if ids is None:
        raise SystemExit(f"{path} does not know its events' objects")
    truths = {int(t_us) // SLICE_US: k for k, t_us in enumerate(recording.times_us)}
    parts: list[dict[str, Scores]] = []
    for estimate, rectification in labelled(recording, whole, model):
        labels, k = estimate.event_labels, truths.get(estimate.start_us // SLICE_US)
        if labels is None or k is None:
            continue
        first, last = np.searchsorted(whole.t, (estimate.start_us, estimate.stop_us))
        true = recording.truth(k).of_movers(ids[first:last])
        x, y = labels.events.x, labels.events.y
        scored = estimate.valid[y, x]
        ways = estimate.ids[y, x], carried_masks(estimate, rectification), labels.objects
        called = zip(WAYS, ways, strict=True)
        parts.append({name: event_scores((way > 0)[scored], true[scored]) for name, way in called})
    return added_rows(parts)


def labelled(recording: Recording, whole: Events, model: str | None) -> Iterator[tuple[Estimate, Rectification]]:
    """The estimates of a recording with labels of events, from a model or from the truth."""
    rectification = rectified(recording.camera)
    if model is not None:
        for estimate in streaming.run(recording.events, model=model, event_labels=True):
            yield estimate, rectification
        return
    labeller = EventLabeller(rectification)
    grid = Labeller(recording).grid
    for k in range(len(recording)):
        estimate = true_estimate(recording.truth(k), grid, rectification)
        window = whole.between(estimate.start_us - SLICE_US, estimate.stop_us + SLICE_US)
        yield labeller.label(estimate, window), rectification


def true_estimate(truth: Truth, grid: NDArray[np.float64], rectification: Rectification) -> Estimate:
    """What a network would say that knows everything of the slice."""
    start_us = truth.t_us // SLICE_US * SLICE_US
    ids = np.where(truth.of_movers(truth.ids) & rectification.valid, truth.ids, 0).astype(np.uint8)
    mean = float(truth.depth[truth.valid].mean()) if truth.valid.any() else 1.0
    rel_depth = np.where(truth.valid, truth.depth / mean, 1).astype(np.float32)
    velocities = np.zeros((256, 3))
    for key in truth.movers:
        velocities[key] = truth.objects[key].velocity / mean
    return Estimate(
        t_us=start_us + SLICE_US // 2,
        start_us=start_us,
        stop_us=start_us + SLICE_US,
        moving_probability=(ids > 0).astype(np.float32),
        ids=ids,
        rel_depth=rel_depth,
        flow=true_flow(truth, grid).astype(np.float32),
        confidence=np.ones_like(rel_depth),
        valid=rectification.valid,
        ego=truth.ego / np.array([mean, mean, mean, 1, 1, 1]),
        objects=measured(ids, rel_depth, velocities),
    )


def carried_masks(estimate: Estimate, rectification: Rectification) -> NDArray[np.uint8]:
    """The mask's id where each event was at the slice's centre, if it moved with the mean flow of that object."""
    assert estimate.event_labels is not None
    events, image = estimate.event_labels.events, rectification.image
    ids = rectification.from_sensor(estimate.ids)
    elapsed_s = (events.t - estimate.t_us) * 1e-6
    found = np.zeros(len(events), np.uint8)
    for moving in estimate.objects:
        u, v = estimate.flow[:, estimate.ids == moving.id].mean(axis=1) * (image.fx, image.fy)
        column = np.rint(rectification.x[events.y, events.x] - u * elapsed_s).astype(int)
        row = np.rint(rectification.y[events.y, events.x] - v * elapsed_s).astype(int)
        inside = (column >= 0) & (column < image.width) & (row >= 0) & (row < image.height)
        inside[inside] = ids[row[inside], column[inside]] == moving.id
        found[inside] = moving.id
    return found


def main() -> None:
    """Score every recording, print the pooled sums."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("--model", default="tiny")
    parser.add_argument("--true", action="store_true", help="start from the truth instead of a model")
    options = parser.parse_args()
    rows = added_rows([recording_scores(path, None if options.true else options.model) for path in options.recordings])
    for name, scores in rows.items():
        numbers = ", ".join(f"{key} {score.value or 0:.3f}" for key, score in scores.items())
        Console(width=110).print(f"{name}: {numbers}")


def label_rows(recording: Path, model: str) -> Iterator[dict[str, Any]]:
    """One row: the median over rounds, after one that is not counted; slices without objects are left out."""
    run = Run(open_events(recording), Network(model))
    slices = list(run.slices())
    labeller = EventLabeller(run.rectification)
    pairs = [
        (slices[k][0], joined([events for _, events in slices[k - 1 : k + 2]]))
        for k in range(1, len(slices) - 1)
        if slices[k][0].objects
    ]
    ms = [_round_ms(labeller, pairs) for _ in range(ROUNDS + 1)][1:]
    count = sum(len(slices[k][1]) for k in range(1, len(slices) - 1) if slices[k][0].objects)
    objects = sum(len(estimate.objects) for estimate, _ in pairs)
    note = f"{recording.name}, {len(pairs)} slices of {count / max(1, len(pairs)):,.0f} events and "
    note += f"{objects / max(1, len(pairs)):.1f} objects, processor time; the events of 75 ms are used for each"
    value = statistics.median(ms) * EVENTS / max(1, count)
    yield {"key": "label_20000_events_ms", "value": value, "unit": "ms", "must": 15.0, "note": note}


def _round_ms(labeller: EventLabeller, pairs: list[tuple[Estimate, Events]]) -> float:
    start = time.process_time()
    for estimate, window in pairs:
        labeller.label(estimate, window)
    return (time.process_time() - start) * 1e3


if __name__ == "__main__":
    main()
