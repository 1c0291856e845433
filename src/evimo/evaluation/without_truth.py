"""What can be said of estimates where nobody knows the truth: do they agree with the events, a gyroscope, themselves?

None of these numbers is an accuracy. A model that is right does well in all of them; one that does well may be wrong.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.evaluation.metrics import overlap, rotation_error
from evimo.evaluation.ratios import Score, Scores, added
from evimo.events.events import Events
from evimo.geometry.rectification import Rectification
from evimo.recordings.estimate import Estimate

F8 = NDArray[np.float64]

FEWEST_EVENTS = 200
"""Slices with fewer events in both images have no contrast worth comparing."""
BESIDE_PX = 0.5 - 12**-0.5
"""How far the image's pixels lie beside the sensor's.

Shared between four pixels, events on whole pixels are not blurred at all, and moved ones are, which alone costs half of
the variance. At this offset u the sums of squares, (1 - u)² + u² = 2/3, and of products of neighbours, u (1 - u) = 1/6,
are those of places spread evenly over a pixel.
"""


def warp_gain(at: F8, flow_px: F8, time_s: F8, size: tuple[int, int]) -> float | None:
    """How much sharper a slice's image gets when each event moves along its flow to the slice's centre.

    The variance of the image of warped events over that of the image of the same events where they were (flow warp
    loss of Stoffregen et al., ECCV 2020); 1 is no flow, more is sharper. Events that either image does not hold are
    in neither.

    Args:
        at: (N, 2) column and row in a pinhole image, px.
        flow_px: (N, 2) image velocity at each, px/s.
        time_s: (N,) seconds after the slice's centre.
        size: (height, width) of the image.

    Returns:
        The gain; None where events are too few.
    """
    moved = at - flow_px * time_s[:, None]
    last = np.array(size[::-1]) - 1.0
    kept = ((at >= 0) & (at < last) & (moved >= 0) & (moved < last)).all(axis=1)
    if np.count_nonzero(kept) < FEWEST_EVENTS:
        return None
    before, after = (_image(places[kept] + BESIDE_PX, size).var() for places in (at, moved))
    return float(after / before)


def _image(at: F8, size: tuple[int, int]) -> F8:
    """Count events (N, 2) into an image, each shared by the four pixels around it."""
    corner = np.floor(at).astype(np.intp)
    share = at - corner
    width = size[1] + 1
    image = np.zeros((size[0] + 1) * width)
    for down, weight_y in ((0, 1 - share[:, 1]), (1, share[:, 1])):
        for right, weight_x in ((0, 1 - share[:, 0]), (1, share[:, 0])):
            place = (corner[:, 1] + down) * width + corner[:, 0] + right
            image += np.bincount(place, weight_y * weight_x, minlength=image.size)
    return image.reshape(-1, width)[:-1, :-1]


def carried(mask: NDArray[np.bool_], flow_px: NDArray[np.floating[Any]]) -> NDArray[np.bool_]:
    """Where a mask (h, w) is one slice later: each pixel reads the mask where it came from, at its own flow there.

    flow_px: (2, h, w), px per slice, of the later slice. Pixels that came from outside the image are False.
    """
    height, width = mask.shape
    y, x = np.indices(mask.shape)
    column, row = np.rint(x - flow_px[0]).astype(np.intp), np.rint(y - flow_px[1]).astype(np.intp)
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    return inside & mask[np.where(inside, row, 0), np.where(inside, column, 0)]


@dataclass
class Agreement:
    """What one model's estimates of a recording agree with, slice by slice; `scores` sums it up.

    times_us, rotations: centres of slices, and the camera's angular velocity in each, rad/s.
    """

    rectification: Rectification
    scores: Scores = field(default_factory=Scores)
    times_us: list[int] = field(default_factory=list[int])
    rotations: list[F8] = field(default_factory=list[F8])
    _before: NDArray[np.bool_] | None = None

    def add(self, estimate: Estimate, events: Events, *, gain: float | None) -> None:
        """Take the next slice; one without events says nothing, and interrupts the comparison of masks.

        gain: the slice's `gain`; None where it does not count.
        """
        if not estimate.has_events:
            self._before = None
            return
        self.times_us.append(estimate.t_us)
        self.rotations.append(estimate.ego[3:])
        sharper = {} if gain is None else {"warp_gain": Score(gain, 1)}
        self.scores = added([self.scores, sharper, self._consistency(estimate), self._called(estimate, events)])

    def gain(self, estimate: Estimate, events: Events) -> float | None:
        """The `warp_gain` of a slice's estimate; None where it has too few events."""
        image, where = self.rectification.image, estimate.valid[events.y, events.x]
        y, x = events.y[where], events.x[where]
        at = np.stack((self.rectification.x[y, x], self.rectification.y[y, x]), axis=1).astype(np.float64)
        flow_px = estimate.flow[:, y, x].T.astype(np.float64) * (image.fx, image.fy)
        return warp_gain(at, flow_px, 1e-6 * (events.t[where] - estimate.t_us).astype(np.float64), image.size)

    def _consistency(self, estimate: Estimate) -> Scores:
        image, dt_s = self.rectification.image, (estimate.stop_us - estimate.start_us) * 1e-6
        if estimate.moving is None:
            return {}
        now, before = self.rectification.from_sensor(estimate.moving), self._before
        self._before = now
        if before is None:
            return {}
        scale = np.array((image.fx, image.fy), np.float32)[:, None, None] * np.float32(dt_s)
        moved = carried(before, self.rectification.from_sensor(estimate.flow) * scale)
        return {
            "consistency": _pooled(moved, now),
            "consistency_still": _pooled(before, now),
        }

    def _called(self, estimate: Estimate, events: Events) -> Scores:
        if estimate.moving is None:
            return {}
        valid = estimate.valid[events.y, events.x]
        moving = estimate.moving[events.y, events.x]
        return {"called_moving": Score(int(np.count_nonzero(moving)), int(np.count_nonzero(valid)))}


def add_slice(agreements: Sequence[Agreement], estimates: Sequence[Estimate], events: Events) -> None:
    """Take the next slice of several models: gains are compared on slices alone where each of them has one."""
    gains = [each.gain(estimate, events) for each, estimate in zip(agreements, estimates, strict=True)]
    shared = None not in gains
    for each, estimate, gain in zip(agreements, estimates, gains, strict=True):
        each.add(estimate, events, gain=gain if shared else None)


def _pooled(first: NDArray[np.bool_], second: NDArray[np.bool_]) -> Score:
    both, either = overlap(first, second)
    return Score(both, either)


def rotation_scores(rotations: F8, measured: F8, *, dt_s: float) -> Scores:
    """Score estimated angular velocities (M, 3) against a gyroscope's, rad/s: angle per second, and over none's."""
    errors = rotation_error(rotations, measured, dt_s=dt_s)
    none = rotation_error(np.zeros_like(measured), measured, dt_s=dt_s)
    return {
        "gyro_rre": Score(float(errors.sum()), len(errors), len(errors)),
        "gyro_rre_ratio": Score(float(errors.sum()), float(none.sum()), len(errors)),
    }


def without_flow(beside: Scores) -> Scores:
    """The row of zero flow beside another: its gain is 1 by definition, over as many slices."""
    samples = beside["warp_gain"].samples if "warp_gain" in beside else 0
    return {"warp_gain": Score(samples, samples, samples)} if samples else {}
