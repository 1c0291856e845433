"""Images of a flickering target from events: how many events each pixel had in short windows."""

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from evimo.events.events import Events, joined

BRIGHTEST = 20  # pixels: as many as a few lights have, and more than are broken
LEAST = 4  # events in a window, that a light has


def count_images(
    packets: Iterable[Events], size: tuple[int, int], *, window_us: int, every_us: int
) -> Iterator[tuple[float, NDArray[np.float64]]]:
    """Mean times of the events in windows, µs, and their counts (H, W); windows without events are left out.

    Args:
        packets: of events, of any sizes.
        size: height and width of the sensor.
        window_us: length of a window; a few periods of the flicker.
        every_us: from one window to the next, at least its length.
    """
    for window in windows(packets, window_us=window_us, every_us=every_us):
        yield _counted(window, size)


def windows(packets: Iterable[Events], *, window_us: int, every_us: int) -> Iterator[Events]:
    """The events of windows that begin at equal distances; those without events, or cut by the end, are left out.

    Args:
        packets: of events, of any sizes.
        window_us: length of a window.
        every_us: from one window to the next, at least its length.
    """
    waiting: Events | None = None
    start: int | None = None
    for packet in filter(len, packets):
        waiting = packet if waiting is None else joined([waiting, packet])
        start = int(waiting.t[0]) if start is None else start
        while waiting.t[-1] >= start + every_us:
            window = waiting.between(start, start + window_us)
            if len(window):
                yield window
            start += every_us
            waiting = waiting.between(start, int(waiting.t[-1]) + 1)
            if not len(waiting):
                waiting = None
                break
            start += max(0, (int(waiting.t[0]) - start) // every_us) * every_us  # a gap costs nothing
        cut = 0 if waiting is None else int(np.searchsorted(waiting.t, start + window_us))
        if waiting is not None and cut < len(waiting) - 1:  # of what lies between windows, only how late it is
            waiting = joined([waiting.part(0, cut), waiting.part(len(waiting) - 1, len(waiting))])
    if waiting is not None and start is not None and waiting.t[-1] >= start + window_us:
        window = waiting.between(start, start + window_us)
        if len(window):
            yield window


def brightness(counts: NDArray[np.float64]) -> float:
    """What counts as full brightness in an image of counts, whatever a few broken pixels do."""
    return max(float(np.partition(counts.ravel(), -BRIGHTEST)[-BRIGHTEST]), LEAST)


def _counted(events: Events, size: tuple[int, int]) -> tuple[float, NDArray[np.float64]]:
    """The mean time of events, those of pixels with many counting more, and their counts.

    A flicker beats against the windows: its events lie up to half a period early or late in them.
    """
    height, width = size
    at = events.y.astype(np.int64) * width + events.x
    counts = np.bincount(at, minlength=height * width)
    first_us = int(events.t[0])
    time_us = first_us + float(np.average((events.t - first_us).astype(np.float64), weights=counts[at]))
    return time_us, counts.reshape(size).astype(np.float64)
