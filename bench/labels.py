"""Event IoU of masks and of labels of events on simulated recordings, whose events know their objects.

    python bench/labels.py RECORDING... [--model tiny]

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
from rich.console import Console

from evimo import streaming
from evimo.evaluation.circles import event_scores
from evimo.evaluation.labels import is_moving
from evimo.evaluation.scores import Scores, added
from evimo.events.events import Events, joined
from evimo.events.io import open_events
from evimo.events.slices import SLICE_US
from evimo.recordings.estimate import Estimate
from evimo.recordings.recording import open_recording
from evimo.streaming.event_labels import EventLabeller
from evimo.streaming.inference import Network
from evimo.streaming.pipeline import Run

EVENTS = 20_000
ROUNDS = 5


def recording_scores(path: Path, model: str) -> dict[str, Scores]:
    """Scores of the mask at each event's pixel and of each event's label, over the slices whose truth is known."""
    recording = open_recording(path)
    ids, whole = recording.event_ids, joined(list(recording.events))
    if ids is None:
        raise SystemExit(f"{path} does not know its events' objects")
    truths = {int(t_us) // SLICE_US: k for k, t_us in enumerate(recording.times_us)}
    parts: dict[str, list[Scores]] = {"mask at the event's pixel": [], "label of the event": []}
    for estimate in streaming.run(recording.events, model=model, event_labels=True):
        labels, k = estimate.event_labels, truths.get(estimate.start_us // SLICE_US)
        if labels is None or k is None:
            continue
        moving = [key for key, body in recording.truth(k).objects.items() if is_moving(body)]
        x, y = labels.events.x, labels.events.y
        scored = estimate.valid[y, x]
        first, last = np.searchsorted(whole.t, (estimate.start_us, estimate.stop_us))
        truth = np.isin(ids[first:last], moving)[scored]
        for name, called in zip(parts, (estimate.ids[y, x] > 0, labels.objects > 0), strict=True):
            parts[name].append(event_scores(called[scored], truth))
    return {name: added(each) for name, each in parts.items()}


def main() -> None:
    """Score every recording, print the pooled sums."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("--model", default="tiny")
    options = parser.parse_args()
    each = [recording_scores(path, options.model) for path in options.recordings]
    for name in each[0]:
        total = added(scores[name] for scores in each)
        numbers = ", ".join(f"{key} {score.value or 0:.3f}" for key, score in total.items())
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
