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
    """Times of the middle of windows in µs, and counts of events (H, W) in them; windows without events are left out.

    Args:
        packets: of events, of any sizes.
        size: height and width of the sensor.
        window_us: length of a window; a few periods of the flicker.
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
                yield start + window_us / 2, _counts(window, size)
            start += every_us
            waiting = waiting.between(start, int(waiting.t[-1]) + 1)
            if not len(waiting):
                waiting = None
                break
            start += max(0, (int(waiting.t[0]) - start) // every_us) * every_us  # a gap costs nothing


def brightness(counts: NDArray[np.float64]) -> float:
    """What counts as full brightness in an image of counts, whatever a few broken pixels do."""
    return max(float(np.partition(counts.ravel(), -BRIGHTEST)[-BRIGHTEST]), LEAST)


def _counts(events: Events, size: tuple[int, int]) -> NDArray[np.float64]:
    height, width = size
    at = events.y.astype(np.int64) * width + events.x
    return np.bincount(at, minlength=height * width).reshape(size).astype(np.float64)
