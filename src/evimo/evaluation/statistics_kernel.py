# pyright: basic
"""One pass over events with a state per pixel: intervals, polarity changes, isolation, counts per slice."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.compiling import njit

BINS_PER_OCTAVE = 64  # of intervals: half a bin is 0.6 %
INTERVAL_BINS = BINS_PER_OCTAVE * 40  # up to 12 days
LARGEST_COUNT = 64  # per pixel and slice; the last bin holds what is beyond
NEVER = -(1 << 62)

CHANGES, ISOLATED, ON, SEEN, QUIET_US = range(5)
"""Places in `Tally.sums`."""


class Tally(NamedTuple):
    """Per pixel (H, W): hot (left out), time and polarity of its last event, whether that has company, count in the
    slice, last event of the 3x3 pixels around it. Then histograms: of intervals, of counts per pixel and slice; sums.
    """

    hot: NDArray[np.bool_]
    last_us: NDArray[np.int64]
    last_p: NDArray[np.int8]
    company: NDArray[np.bool_]
    count: NDArray[np.int64]
    around_us: NDArray[np.int64]
    intervals: NDArray[np.int64]
    counts: NDArray[np.int64]
    sums: NDArray[np.int64]


def empty_tally(hot: NDArray[np.bool_]) -> Tally:
    """Nothing seen yet; time begins at 0."""
    size = hot.shape
    return Tally(
        hot,
        np.full(size, NEVER, np.int64),
        np.zeros(size, np.int8),
        np.zeros(size, bool),
        np.zeros(size, np.int64),
        np.zeros(size, np.int64),
        np.zeros(INTERVAL_BINS, np.int64),
        np.zeros(LARGEST_COUNT + 1, np.int64),
        np.zeros(5, np.int64),
    )


@njit(nogil=True)
def tally_slice(x, y, t, p, alone_us, stop_us, tally):
    """Add the events of one slice, times counted from the recording's start, and close the slice.

    An event is isolated if none other lies within `alone_us` before or after it in the 3x3 pixels around it; it is
    judged when its pixel fires again, as company may come later. `stop_us` is the recording's end.
    """
    for i in range(len(t)):
        row, column, now = np.int64(y[i]), np.int64(x[i]), t[i]
        if tally.hot[row, column]:
            continue
        company = _meet(row, column, now, alone_us, tally)
        before = tally.last_us[row, column]
        if before != NEVER:
            place = int(BINS_PER_OCTAVE * math.log2(1 + max(now - before, 0)))
            tally.intervals[min(place, INTERVAL_BINS - 1)] += 1
            tally.sums[CHANGES] += tally.last_p[row, column] != p[i]
            _judge(row, column, alone_us, stop_us, tally)
        tally.last_us[row, column], tally.last_p[row, column] = now, p[i]
        tally.company[row, column] = company
        tally.count[row, column] += 1
        tally.sums[ON] += p[i] > 0
        tally.sums[SEEN] += 1
    height, width = tally.count.shape
    for row in range(height):
        for column in range(width):
            tally.counts[min(tally.count[row, column], LARGEST_COUNT)] += 1
            tally.count[row, column] = 0


@njit(nogil=True)
def _meet(row, column, now, alone_us, tally):
    """Tell recent events of the 3x3 pixels that they have company; whether there are any. Adds up quiet time."""
    height, width = tally.count.shape
    company = False
    for v in range(max(row - 1, 0), min(row + 2, height)):
        for u in range(max(column - 1, 0), min(column + 2, width)):
            if now - tally.last_us[v, u] <= alone_us:
                tally.company[v, u] = company = True
            tally.sums[QUIET_US] += max(now - tally.around_us[v, u] - 2 * alone_us, 0)
            tally.around_us[v, u] = now
    return company


@njit(nogil=True)
def _judge(row, column, alone_us, stop_us, tally):
    """Count the last event of a pixel if it was isolated; too near the recording's ends nobody knows."""
    at = tally.last_us[row, column]
    tally.sums[ISOLATED] += not tally.company[row, column] and alone_us <= at <= stop_us - alone_us


@njit(nogil=True)
def finish(alone_us, stop_us, tally):
    """Judge the last event of every pixel and add the quiet time that is left."""
    height, width = tally.count.shape
    for row in range(height):
        for column in range(width):
            if not tally.hot[row, column]:
                _judge(row, column, alone_us, stop_us, tally)
            tally.sums[QUIET_US] += max(stop_us - tally.around_us[row, column] - 2 * alone_us, 0)
