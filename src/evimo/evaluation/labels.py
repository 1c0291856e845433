"""One slice with its truth, ready to be scored: what moves in it, what fires, which pixels count."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.evaluation.metrics import Mask
from evimo.events.events import Events
from evimo.recordings.truth import Truth

SMALL_AREA_PX = 30
"""Of objects with fewer scored pixels neither velocity nor detection is scored."""


@dataclass(frozen=True, slots=True)
class Mover:
    """One object that moves at this instant and is seen in at least one `scored` pixel.

    area_px:     its scored pixels; active_px: those with events.
    area:        its share of all scored pixels.
    residual_px: median residual motion of its scored pixels at their true depths, px per slice; None where not known.
    familiar:    whether training has seen its family of shapes; None where nobody says.
    """

    id: int
    area_px: int
    active_px: int
    area: float
    residual_px: float | None
    familiar: bool | None


@dataclass(frozen=True, slots=True)
class Residual:
    """How far the true flow differs from what the static world does, px per slice, (H, W), each pixel on its own.

    depth_known:   from the flow of a static point at the pixel's true depth.
    depth_unknown: from the nearest of the flows that static points at any depth have.
    valid:         where depth is known; elsewhere nothing is said.
    """

    depth_known: NDArray[np.float32]
    depth_unknown: NDArray[np.float32]
    valid: Mask


@dataclass(frozen=True, slots=True)
class LabelledSlice:
    """Everything the scores of one slice need besides the prediction; maps are (H, W) in sensor pixels.

    events:    those of the slice whose pixel is `scored`.
    kept:      (M,) which of all the slice's events they are: labels of all become theirs by `labels[sample.kept]`.
    event_ids: the object that made each of `events`, by its own word, 0 is static; None where it is not known.
    scored:    pixels the lens maps into the rectified image: elsewhere the model says nothing and nothing is scored.
    moving:    an object that moves at this instant is seen here (all pixels, `scored` or not).
    movers:    what moves, object by object.
    resting:   an object that could move but rests is seen here.
    active:    `scored` pixels with at least one event.
    flow:      (2, H, W) true image velocity on the plane Z = 1 in 1/s, or None where it is not known.
    residual:  motion against the static world, or None where flow is not known.
    focal_px:  (fx, fy) of the sensor's camera.
    dt_s:      length of the slice.
    """

    events: Events
    kept: Mask
    event_ids: NDArray[np.uint8] | None
    truth: Truth
    scored: Mask
    moving: Mask
    movers: tuple[Mover, ...]
    resting: Mask
    active: Mask
    flow: NDArray[np.float32] | None
    residual: Residual | None
    focal_px: tuple[float, float]
    dt_s: float


def labelled(
    events: Events,
    truth: Truth,
    *,
    scored: Mask,
    focal_px: tuple[float, float],
    dt_s: float,
    flow: NDArray[np.float32] | None = None,
    residual: Residual | None = None,
    event_ids: NDArray[np.uint8] | None = None,
    familiar: Mapping[int, bool] | None = None,
) -> LabelledSlice:
    """A slice's events and truth as one `LabelledSlice`; `event_ids` of all its events, `familiar` by object."""
    moving = truth.of_movers(truth.ids)
    kept = scored[events.y, events.x]
    inside = Events(events.x[kept], events.y[kept], events.t[kept], events.p[kept])
    active = np.zeros(scored.shape, np.bool_)
    active[inside.y, inside.x] = True
    resting = (truth.ids > 0) & ~moving
    known = familiar or {}
    movers = [
        Mover(
            key, *_extent(truth.ids == key, scored, active), _median(truth.ids == key, scored, residual), known.get(key)
        )
        for key in np.unique(truth.ids[moving & scored]).tolist()
    ]
    return LabelledSlice(
        events=inside,
        kept=kept,
        event_ids=None if event_ids is None else event_ids[kept],
        truth=truth,
        scored=scored,
        moving=moving,
        movers=tuple(movers),
        resting=resting,
        active=active,
        flow=flow,
        residual=residual,
        focal_px=focal_px,
        dt_s=dt_s,
    )


def _extent(inside: Mask, scored: Mask, active: Mask) -> tuple[int, int, float]:
    """Scored pixels of an object, those with events, and its share of all scored pixels."""
    area_px = int(np.count_nonzero(inside & scored))
    return area_px, int(np.count_nonzero(inside & active)), area_px / int(np.count_nonzero(scored))


def _median(inside: Mask, scored: Mask, residual: Residual | None) -> float | None:
    """Median residual motion of an object, px per slice; None where none is known."""
    if residual is None or not (chosen := inside & scored & residual.valid).any():
        return None
    return float(np.median(residual.depth_known[chosen]))
