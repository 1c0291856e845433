"""What the events of one recording look like, whatever they show: intervals, polarity, counts, isolated events."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadInput
from evimo.evaluation import statistics_kernel as kernel
from evimo.events.events import Events
from evimo.events.slices import SLICE_US, in_slices
from evimo.formats.event_file import EventFile

ALONE_US = 10_000
"""An isolated event has no other this long before or after it in its pixel and the eight around it."""

HOT_HZ, HOT_EVENTS, HOT_TIMES = 10, 10, 5
"""A hot pixel fires at least so often, at least so many times, and more than so many times as often as each of the
eight around it. One such pixel at 9 kHz, as real sensors have, would make up all short intervals of a quiet clip."""

INTERVAL_PERCENTILES = (0.1, 1, 5, 25, 50)
LONGEST_MS = SLICE_US * 1e-3
"""Percentiles are of intervals up to one slice: longer ones say more of the scene and of how long the clip is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EventStatistics:
    """Statistics of one recording over its whole slices, counted from its first event, without its hot pixels.

    sensor:    (height, width) in px. slices: how many of 25 ms. events: in them, with those of hot pixels.
    values:    by name (see `realism.MEASURES`); None where nothing was seen that it could be taken from.
    intervals: number of intervals of each length (see `interval_ms`), int64.
    counts:    number of (pixel, slice) with that many events, int64; the last holds all above.
    per_slice: events of each slice, hot pixels included, int64.
    """

    name: str
    sensor: tuple[int, int]
    slices: int
    events: int
    hot_pixels: int
    values: Mapping[str, float | None]
    intervals: NDArray[np.int64]
    counts: NDArray[np.int64]
    per_slice: NDArray[np.int64]

    @property
    def seconds(self) -> float:
        """How long its whole slices last."""
        return self.slices * SLICE_US * 1e-6


def event_statistics(
    recording: EventFile, *, name: str = "", advance: Callable[[], object] | None = None
) -> EventStatistics:
    """Read a recording twice, in constant memory: for its hot pixels, then for the rest.

    Args:
        recording: of at least one slice of 25 ms. name: for tables; the file's if empty.
        advance: called after each slice.

    Raises:
        BadInput: it is shorter.
    """
    slices = whole_slices(recording)
    if not slices:
        span_ms = (recording.stop_us - recording.start_us) * 1e-3
        raise BadInput(f"{recording.path.name} lasts {span_ms:.1f} ms", fix="a recording of at least 25 ms")
    span_us = slices * SLICE_US
    hot = hot_pixels(_events_per_pixel(recording, span_us), span_us)
    tally, per_slice = kernel.empty_tally(hot), np.zeros(slices, np.int64)
    for part in in_slices(_from_start(recording, span_us), start_us=0, stop_us=span_us):
        events = part.events
        kernel.tally_slice(events.x, events.y, events.t, events.p, ALONE_US, span_us, tally)
        per_slice[part.index] = len(events)
        if advance is not None:
            advance()
    kernel.finish(ALONE_US, span_us, tally)
    return EventStatistics(
        name=name or recording.path.name,
        sensor=recording.sensor,
        slices=slices,
        events=int(per_slice.sum()),
        hot_pixels=int(hot.sum()),
        values=_values(tally, per_slice),
        intervals=tally.intervals,
        counts=tally.counts,
        per_slice=per_slice,
    )


def whole_slices(recording: EventFile) -> int:
    """How many slices of 25 ms lie between its first and its last event."""
    return (recording.stop_us - recording.start_us) // SLICE_US


def interval_ms(place: NDArray[np.int64]) -> NDArray[np.float64]:
    """The length in the middle of bins of `EventStatistics.intervals`, right to 0.6 %."""
    return (np.exp2((place + 0.5) / kernel.BINS_PER_OCTAVE) - 1) * 1e-3


def shares_up_to(statistics: EventStatistics, lengths_ms: NDArray[np.float64]) -> NDArray[np.float64]:
    """The share of intervals up to each length; zeros where there are no intervals."""
    below = np.searchsorted(interval_ms(np.arange(kernel.INTERVAL_BINS)), lengths_ms, "right")
    total = max(int(statistics.intervals.sum()), 1)
    return np.concatenate(([0], np.cumsum(statistics.intervals)))[below] / total


def count_shares(statistics: EventStatistics) -> NDArray[np.float64]:
    """The share of active pixels with 1, 2, 3 … events in a slice; zeros where none is active."""
    active = statistics.counts[1:]
    return active / max(int(active.sum()), 1)


def hot_pixels(totals: NDArray[np.int64], span_us: int) -> NDArray[np.bool_]:
    """Which pixels are hot, from the events of each pixel (H, W) in span_us."""
    ring = np.ones((3, 3), np.uint8)
    ring[1, 1] = 0
    around = cv2.dilate(totals.astype(np.float64), ring, borderType=cv2.BORDER_CONSTANT, borderValue=(0.0,))
    return (totals >= max(HOT_EVENTS, HOT_HZ * span_us * 1e-6)) & (totals > HOT_TIMES * around)


def _events_per_pixel(recording: EventFile, span_us: int) -> NDArray[np.int64]:
    height, width = recording.sensor
    totals = np.zeros(height * width, np.int64)
    for part in in_slices(_from_start(recording, span_us), start_us=0, stop_us=span_us):
        totals += np.bincount(part.events.y * np.int64(width) + part.events.x, minlength=len(totals))
    return totals.reshape(height, width)


def _from_start(recording: EventFile, span_us: int) -> Iterator[Events]:
    """Its packets with times counted from its first event."""
    start_us = recording.start_us
    for packet in recording.packets(start_us, start_us + span_us):
        yield Events(packet.x, packet.y, packet.t - start_us, packet.p)


def _values(tally: kernel.Tally, per_slice: NDArray[np.int64]) -> dict[str, float | None]:
    """Every statistic by name."""
    pixels, seconds = int((~tally.hot).sum()), len(per_slice) * SLICE_US * 1e-6
    seen, active = int(tally.sums[kernel.SEEN]), int(tally.counts[1:].sum())
    isolated = int(tally.sums[kernel.ISOLATED])
    judged_s = seconds - 2e-6 * ALONE_US
    values = _interval_values(tally.intervals)
    values["changes"] = _ratio(tally.sums[kernel.CHANGES], tally.intervals.sum())
    values["on"] = _ratio(tally.sums[kernel.ON], seen)
    values["per_active"] = _ratio(seen, active)
    values["one"], values["four"] = (_ratio(part.sum(), active) for part in (tally.counts[1:2], tally.counts[4:]))
    values["isolated"] = _ratio(isolated, pixels * judged_s)
    values["quiet"] = _ratio(isolated, tally.sums[kernel.QUIET_US] * 1e-6)
    values["hot"] = 1e6 * float(tally.hot.mean())
    values["rate"] = _ratio(seen, pixels * seconds)
    values["active"] = _ratio(active, pixels * len(per_slice))
    for percent in (10, 50, 90):
        values[f"slice_{percent}"] = float(np.percentile(per_slice, percent)) / tally.hot.size
    return values


def _interval_values(intervals: NDArray[np.int64]) -> dict[str, float | None]:
    """Percentiles of the intervals up to `LONGEST_MS`, and the share of the longer ones."""
    lengths_ms = interval_ms(np.arange(len(intervals)))
    reached = np.cumsum(intervals[lengths_ms <= LONGEST_MS])
    number = int(reached[-1])
    values: dict[str, float | None] = {}
    for percent in INTERVAL_PERCENTILES:
        place = np.searchsorted(reached, max(number * percent / 100, 1))
        values[f"interval_{percent:g}"] = float(lengths_ms[place]) if number else None
    values["longer"] = _ratio(intervals[len(reached) :].sum(), intervals.sum())
    return values


def _ratio(top: float, bottom: float) -> float | None:
    return float(top / bottom) if bottom > 0 else None
