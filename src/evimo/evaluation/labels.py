"""One slice with its truth, ready to be scored: what moves in it, what fires, which pixels count."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.evaluation.metrics import Mask
from evimo.events.events import Events
from evimo.recordings.truth import Truth


@dataclass(frozen=True, slots=True)
class LabelledSlice:
    """Everything the scores of one slice need besides the prediction; maps are (H, W) in sensor pixels.

    events:   those of the slice whose pixel is `scored`.
    scored:   pixels the lens maps into the rectified image: elsewhere the model says nothing and nothing is scored.
    moving:   an object that moves at this instant is seen here (all pixels, `scored` or not).
    resting:  an object that could move but rests is seen here.
    active:   `scored` pixels with at least one event.
    flow:     (2, H, W) true image velocity on the plane Z = 1 in 1/s, or None where it is not known.
    focal_px: (fx, fy) of the sensor's camera.
    dt_s:     length of the slice.
    """

    events: Events
    truth: Truth
    scored: Mask
    moving: Mask
    resting: Mask
    active: Mask
    flow: NDArray[np.float32] | None
    focal_px: tuple[float, float]
    dt_s: float


def moving_mask(truth: Truth) -> Mask:
    """(H, W), where an object that moves at this instant is seen."""
    return np.isin(truth.ids, [key for key, body in truth.objects.items() if body.moves])


def labelled(
    events: Events,
    truth: Truth,
    *,
    scored: Mask,
    focal_px: tuple[float, float],
    dt_s: float,
    flow: NDArray[np.float32] | None = None,
) -> LabelledSlice:
    """A slice's events and truth as one `LabelledSlice`."""
    moving = moving_mask(truth)
    kept = scored[events.y, events.x]
    inside = Events(events.x[kept], events.y[kept], events.t[kept], events.p[kept])
    active = np.zeros(scored.shape, np.bool_)
    active[inside.y, inside.x] = True
    resting = (truth.ids > 0) & ~moving
    return LabelledSlice(inside, truth, scored, moving, resting, active, flow, focal_px, dt_s)
