"""One moving object as a layer: its own motion, sharpened on the events near it, and which of them follow it.

Where a network sees an object for 25 ms and perhaps a pixel or two off, its events say more: carried back along the
motion of what they belong to they fall onto each other. So each event is asked two questions: was the place it came
from, along the object's motion, in the mask; and do the events there lie closer together along the object's motion or
along that of the static world? The object's motion itself is the one that makes its events sharpest (Gallego et al.
2018; layers as in Stoffregen et al. 2019), found from the network's by a few rounds of fitting and sharing out.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.classical.sharpness import ARM, MARGIN, PEAK, read, sharpest, sharpness, warp_back
from evimo.streaming.nearby import Nearby

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]

ROUNDS = 3  # of fitting the motion and sharing out the events
SPREAD = np.array([20.0, 20.0, 0.5, 0.5])  # px per slice by which the network's motion may be off
FEWEST, MOST = 20, 3000  # events that a motion is fitted to
SURELY = 0.05  # share of an event from which on it takes part in the fit
SHARPER = 1.05  # than by the static world's motion: else the network's motion stays
EVIDENCE, EVIDENCE_TO_FIT = np.float32(1), np.float32(2)  # how much closeness counts against the mask
NOISE = np.float32(0.2)  # events per pixel added to both images
SUREST = np.float32(0.95)  # that the mask can be
FADE_PX, SOFT_PX = 4.0, 0.7  # how the mask ends


@dataclass(frozen=True, slots=True)
class Followed:
    """What was found of one object.

    motion:  (4,) as in `sharpness`, about the mask's centre.
    sharper: its events are sharper by its own motion than by the static world's; else `motion` is the network's.
    odds:    (N,) of each nearby event to belong to the object: above 1 it does.
    """

    motion: F8
    sharper: bool
    odds: F4


def start_motion(flow: F4, x: F4, y: F4, centre: tuple[float, float]) -> F8:
    """The motion (4,) that fits a flow (2, N) in px per slice best at x, y (N,) px."""
    dx, dy = (x - centre[0]) / ARM, (y - centre[1]) / ARM
    u, v = flow.mean(axis=1, dtype=np.float64)
    du, dv = flow[0] - u, flow[1] - v
    size = float(dx @ dx + dy @ dy) + 30  # few pixels tell nothing of expansion and turn
    return np.array((u, v, float(du @ dx + dv @ dy) / size, float(dv @ dx - du @ dy) / size))


def motion_at(motion: F8, x: F4, y: F4, centre: tuple[float, float]) -> F4:
    """The flow (2, N) in px per slice of a motion at x, y (N,) px."""
    u, v, s, r = motion
    dx, dy = (x - centre[0]) / ARM, (y - centre[1]) / ARM
    return np.stack((u + s * dx - r * dy, v + s * dy + r * dx)).astype(np.float32)


def mask_prior(probability: F4, mine: NDArray[np.bool_], others: NDArray[np.bool_]) -> F4:
    """How likely a pixel of the box shows the object, from the network alone, (h, w) with the margin of images.

    Inside its mask at least one half, outside at most that and fading with the distance; nothing in other masks.
    """
    away = cv2.distanceTransform((~mine).astype(np.uint8), cv2.DIST_L2, 3)
    around = np.minimum(probability, 0.5) * np.exp(-np.maximum(away - 1, 0) / FADE_PX)
    prior = np.where(mine, np.maximum(probability, 0.5), np.where(others, 0, around)).astype(np.float32)
    return np.pad(np.asarray(cv2.GaussianBlur(prior, (0, 0), SOFT_PX), np.float32), MARGIN)


def follow(near: Nearby, prior: F4, start: F8, centre: tuple[float, float]) -> Followed:
    """Sharpen an object's motion on the events near it, and tell its events from those of the static world.

    Args:
        near: the events.
        prior: from `mask_prior`.
        start: its motion as the network sees it.
        centre: of the mask, px in the box.
    """
    room = np.empty((3, *prior.shape), np.float32)
    still = _closeness(near.static, room)
    motion, share = start, _inside(near, prior, start, centre)
    for _ in range(ROUNDS):
        own = np.flatnonzero(share > SURELY)
        if len(own) < FEWEST:
            break
        own = own[:: 1 + len(own) // MOST]
        motion = sharpest(near.x[own], near.y[own], near.t[own], share[own], motion, centre, SPREAD, room)
        odds = _odds(near, prior, motion, centre, still=still, evidence=EVIDENCE_TO_FIT, room=room)
        share = odds / (1 + odds)
    at = _warped(near, motion, centre)
    sharper = bool(sharpness(at, share, room) > SHARPER * sharpness(near.static, share, room))
    motion = motion if sharper else start
    return Followed(motion, sharper, _odds(near, prior, motion, centre, still=still, evidence=EVIDENCE, room=room))


def _odds(
    near: Nearby, prior: F4, motion: F8, centre: tuple[float, float], *, still: F4, evidence: np.float32, room: F4
) -> F4:
    """Of each event (N,) to belong to the object, by the mask where it came from and by how close the events lie."""
    inside = _inside(near, prior, motion, centre)
    closer = _closeness(_warped(near, motion, centre), room) / still
    odds: F4 = inside / (1 - inside)
    return odds * np.power(closer, evidence, dtype=np.float32)


def _inside(near: Nearby, prior: F4, motion: F8, centre: tuple[float, float]) -> F4:
    """The prior (N,) where each event came from, never certain."""
    into = np.empty(len(near.x), np.float32)
    read(_warped(near, motion, centre), prior, into)
    np.minimum(into, SUREST, out=into)
    return into


def _warped(near: Nearby, motion: F8, centre: tuple[float, float]) -> F4:
    at = np.empty((2, len(near.x)), np.float32)
    warp_back(near.x, near.y, near.t, motion, centre, at)
    return at


def _closeness(at: F4, room: F4) -> F4:
    """How many other events lie at each event's place, (N,), all events warped alike."""
    into = np.empty(at.shape[1], np.float32)
    sharpness(at, np.ones(at.shape[1], np.float32), room)
    read(at, room[2], into)
    return np.maximum(into - np.float32(PEAK), 0) + NOISE
