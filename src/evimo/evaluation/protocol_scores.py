"""What one slice scores under each published protocol; what they are is in `protocols`."""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.evaluation import metrics
from evimo.evaluation.instances import (
    Identities,
    Instances,
    Overlaps,
    connected,
    instances_of,
    matched_scores,
    overlaps,
)
from evimo.evaluation.labels import SMALL_AREA_PX, LabelledSlice
from evimo.evaluation.metrics import Mask
from evimo.evaluation.outlines import box_px, boxes_of, hulls, shared_box
from evimo.evaluation.ranked import Ranked, ranked_detections
from evimo.evaluation.ratios import Score, Scores, added
from evimo.recordings.prediction import Prediction

SPIKEMS_US = 10_000  # before and after the instant of the truth
SPIKEMS_DILATION_PX = 5
SPIKEMS_RATIOS = (1.5, 3.0)
"""Events off the movers to events on them, above which a slice is left out; both ends of what its authors name."""


class ProtocolScores(NamedTuple):
    """Scores that add up, and what must be ranked first."""

    scores: Scores
    ranked: Ranked


class Protocols:
    """Scores the slices of one recording, in their order, under every protocol that the predictions are enough for."""

    def __init__(self) -> None:
        self._identities = Identities()

    def of_maps(self, prediction: Prediction, sample: LabelledSlice) -> ProtocolScores:
        """Of a prediction with a mask, and with ids where it has them; else its regions are its objects."""
        if prediction.moving is None:
            return ProtocolScores({}, Ranked())
        called, true = prediction.moving & sample.scored, sample.moving & sample.scored
        certainty, ids = prediction.probability, prediction.ids
        found = (
            connected(called, certainty, sample.scored) if ids is None else instances_of(ids, certainty, sample.scored)
        )
        pairs = overlaps(found, sample)
        named = found.labels[sample.events.y, sample.events.x].astype(np.int64)
        scores = whole_mask_scores(called, true, sample.scored)
        scores |= event_scores(called[sample.events.y, sample.events.x], sample) | hull_scores(named, sample)
        scores |= detection_rates(found, pairs, sample) | matched_scores(pairs)
        if ids is not None:
            scores |= self._identities.scores(pairs)
        frame_iou = (scores["iou_all_frames"].top,) if true.any() else ()
        ranked = ranked_detections(pairs, moving_px=int(np.count_nonzero(true)))
        return ProtocolScores(scores, ranked + Ranked(frame_iou=frame_iou))

    def of_events(self, objects: NDArray[np.int64], sample: LabelledSlice) -> Scores:
        """Of the object (N,) that each of the slice's events belongs to; 0 is static."""
        named = objects[sample.kept]
        return event_scores(named > 0, sample) | hull_scores(named, sample)


def whole_mask_scores(called: Mask, true: Mask, scored: Mask) -> Scores:
    """Protocols that compare two masks (H, W), both within `scored`."""
    cut, union = metrics.overlap(called, true)
    iou = cut / union if union else 1.0
    scores = {
        "iou_all_frames": Score(iou, 1),
        "detected_mask": Score(int(iou >= 0.5 and cut >= np.count_nonzero(called & ~true)), 1),
    }
    if true.any():
        scores["iou_classes"] = Score(class_mean(called, true, scored), 1)
    half_called, half_true = halved(called, scored), halved(true, scored)
    if half_true.any():
        cut, union = metrics.overlap(half_called, half_true)
        scores["iou_half"] = Score(cut / union, 1)
    return scores


def class_mean(called: Mask, true: Mask, scored: Mask) -> float:
    """Mean of the IoU of movers and of that of the background, over the classes that either mask has."""
    pairs = [metrics.overlap(called, true), metrics.overlap(scored & ~called, scored & ~true)]
    return float(np.mean([cut / union for cut, union in pairs if union]))


def halved(mask: Mask, scored: Mask) -> Mask:
    """A mask at half its size: a block of 2x2 is in it where at least half of the block's scored pixels are, if any."""
    height, width = mask.shape[0] // 2, mask.shape[1] // 2

    def count(what: Mask) -> NDArray[np.uint8]:
        ones = what[: 2 * height, : 2 * width].view(np.uint8)
        return ones[::2, ::2] + ones[1::2, ::2] + ones[::2, 1::2] + ones[1::2, 1::2]

    inside, of_all = count(mask & scored), count(scored)
    return (2 * inside >= of_all) & (of_all > 0)


def event_scores(called: Mask, sample: LabelledSlice) -> Scores:
    """Protocols that look at pixels with events; `called` (N,) are those of the slice's events that move."""
    x, y, t = sample.events.x, sample.events.y, sample.events.t
    predicted = at_pixels(x[called], y[called], sample.scored.shape)
    cut, union = metrics.overlap(predicted, sample.moving & sample.active)
    scores: Scores = {}
    if (sample.moving & sample.active).any():
        scores["iou_event_pixels"] = Score(cut / union, 1)
    near = (t >= sample.truth.t_us - SPIKEMS_US) & (t < sample.truth.t_us + SPIKEMS_US)
    area_px = int(np.count_nonzero(sample.moving & sample.scored))
    wide = cv2.dilate(sample.moving.view(np.uint8), np.ones((SPIKEMS_DILATION_PX,) * 2, np.uint8)).view(np.bool_)
    active = at_pixels(x[near], y[near], sample.scored.shape)
    inside = int(np.count_nonzero(wide[y[near], x[near]]))
    outside = int(np.count_nonzero(near)) - inside
    cut, union = metrics.overlap(at_pixels(x[near & called], y[near & called], sample.scored.shape), wide & active)
    for ratio in SPIKEMS_RATIOS:
        kept = area_px >= SMALL_AREA_PX and inside > 0 and outside <= ratio * inside
        scores[f"spikems_kept_{ratio:g}"] = Score(int(kept), 1)
        if kept:
            scores[f"iou_spikems_{ratio:g}"] = Score(cut / union, 1)
    return scores


def at_pixels(x: NDArray[np.uint16], y: NDArray[np.uint16], size: tuple[int, ...]) -> Mask:
    """Where events are, (H, W)."""
    mask = np.zeros(size, np.bool_)
    mask[y, x] = True
    return mask


def hull_scores(named: NDArray[np.int64], sample: LabelledSlice) -> Scores:
    """Dense IoU of the convex hulls of clusters; `named` (N,) is the cluster of each of the slice's events, 0 none."""
    height, width = sample.scored.shape
    drawn = hulls(sample.events.x, sample.events.y, named, (height, width)) & sample.scored
    true = sample.moving & sample.scored
    cut, union = metrics.overlap(drawn, true)
    return {"iou_hulls": Score(cut / union, 1)} if true.any() else {}


def detection_rates(found: Instances, pairs: Overlaps, sample: LabelledSlice) -> Scores:
    """Share of the movers of at least 30 pixels that one predicted object finds, by box and by region."""
    boxes = boxes_of(found.labels)
    parts: list[Scores] = []
    for column, mover in enumerate(sample.movers):
        if mover.area_px < SMALL_AREA_PX:
            continue
        rows, columns = np.nonzero(sample.scored & (sample.truth.ids == mover.id))
        true = int(columns.min()), int(rows.min()), int(columns.max()), int(rows.max())
        shared = [(box_px(shared_box(box, true)), box_px(box)) for box in boxes]
        own = [(cut, px) for cut, px in shared if 2 * cut > px]  # more of the box on the true one than off it
        area_px = box_px(true)
        rates = {
            "detected_box": any(2 * cut > area_px for cut, _ in own),
            "detected_box_iou": any(2 * cut > area_px + px - cut for cut, px in own),
            "detected_region": bool((pairs.iou[:, column] > 0.5).any()),
        }
        parts.append({name: Score(int(rate), 1) for name, rate in rates.items()})
    return added(parts)
