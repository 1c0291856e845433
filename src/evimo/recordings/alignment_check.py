"""Whether masks and events show the same moment: how long before or after a mask its outlines fire most."""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.events.events import Events
from evimo.recordings.recording import Recording

REACH_MS = 40  # that is looked at, to each side
FRAMES = 60  # that are looked at, spread over the recording
LEAST_PX = 60  # of a moving outline in a frame
LEAST_EVENTS = 500  # on outlines, per millisecond of the whole reach taken together
SMOOTHED_MS = 5
CLEAR = 1.1  # times the usual share of events, which outlines have at their best offset


@dataclass(frozen=True, slots=True)
class Alignment:
    """When outlines fire most, against the times of their masks.

    offset_ms: of the events against the masks; positive where events are later. None where nothing can be told.
    contrast:  the share of events on outlines there, against the usual share.
    frames:    how many masks were compared.
    """

    offset_ms: float | None
    contrast: float
    frames: int


def alignment_of(recording: Recording) -> Alignment:
    """Compare the outlines of what moves with the events before and after, in one pass over the events.

    Of the events near an outline, most lie on it at the moment that the mask shows; where it moves, its events at
    other moments lie beside it.
    """
    frames = list(_outlined(recording))
    on, near = np.zeros((2, 2 * REACH_MS + 1))
    first = 0
    for packet in recording.events.packets():
        while first < len(frames) and frames[first].t_us + (REACH_MS + 1) * 1000 < packet.t[0]:
            first += 1
        for frame in frames[first:]:
            if frame.t_us - (REACH_MS + 1) * 1000 > packet.t[-1]:
                break
            frame.count(packet, on, near)
    if not frames or on.sum() < LEAST_EVENTS or not (near > 0).all():
        return Alignment(None, 0.0, len(frames))
    kernel = np.ones(SMOOTHED_MS)
    share = np.convolve(on, kernel, "valid") / np.convolve(near, kernel, "valid")
    contrast = float(share.max() / np.median(share))
    best = int(share.argmax())
    if contrast < CLEAR or best in (0, len(share) - 1):
        return Alignment(None, contrast, len(frames))
    return Alignment(_middle(share, best) + SMOOTHED_MS // 2 - REACH_MS, contrast, len(frames))


def _middle(share: NDArray[np.float64], best: int) -> float:
    """The middle of what lies above half of the peak, to a part of a millisecond: two edges make its top flat."""
    level = (share[best] + np.median(share)) / 2
    above = share > level
    low, high = best, best
    while low > 0 and above[low - 1]:
        low -= 1
    while high < len(share) - 1 and above[high + 1]:
        high += 1
    weight = share[low : high + 1] - level
    return float((weight * np.arange(low, high + 1)).sum() / weight.sum())


@dataclass(frozen=True, slots=True)
class _Outline:
    """A frame's time, the pixels on the outlines of what moves (H, W), and those near them."""

    t_us: int
    band: NDArray[np.bool_]
    zone: NDArray[np.bool_]

    def count(self, packet: Events, on: NDArray[np.float64], near: NDArray[np.float64]) -> None:
        """Add the events of a packet, by their distance in time."""
        events = packet.between(self.t_us - REACH_MS * 1000 - 500, self.t_us + REACH_MS * 1000 + 500)
        if not len(events):
            return
        inside = self.zone[events.y, events.x]
        late_ms = (events.t[inside] - self.t_us + 500) // 1000 + REACH_MS
        late_ms = np.clip(late_ms, 0, 2 * REACH_MS)
        sharp = self.band[events.y[inside], events.x[inside]]
        near += np.bincount(late_ms, minlength=len(near))
        on += np.bincount(late_ms[sharp], minlength=len(on))


def _outlined(recording: Recording) -> Iterator[_Outline]:
    """Frames in which something moves, spread evenly; outlines at the border of the sensor are left out."""
    for k in np.unique(np.linspace(0, len(recording) - 1, FRAMES).astype(int)).tolist() if len(recording) else []:
        truth = recording.truth(k)
        moving = truth.of_movers(truth.ids).astype(np.uint8)
        band = cv2.morphologyEx(moving, cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8)) > 0
        band[[0, -1]], band[:, [0, -1]] = False, False
        if np.count_nonzero(band) >= LEAST_PX:
            zone = cv2.dilate(band.astype(np.uint8), np.ones((17, 17), np.uint8)) > 0
            yield _Outline(truth.t_us, band, zone)
