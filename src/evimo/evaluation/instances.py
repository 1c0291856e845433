"""Objects one by one: which predicted object is which true one, in one slice and from slice to slice."""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.evaluation.assignment import best_assignment
from evimo.evaluation.labels import SMALL_AREA_PX, LabelledSlice
from evimo.evaluation.metrics import Mask
from evimo.evaluation.ratios import Score, Scores

Ints = NDArray[np.int64]
SAME = 0.5
"""Two disjoint sets of masks share pairs above this overlap in one way alone: no rule for ties is needed."""


class Instances(NamedTuple):
    """The predicted objects of one slice.

    labels: (H, W) int32, 0 or 1 + the object's place in `names`.
    names:  (P,) how the program calls them.
    score:  (P,) how sure it is of each, 0...1.
    """

    labels: NDArray[np.int32]
    names: Ints
    score: NDArray[np.float64]


class Overlaps(NamedTuple):
    """P predicted and T true objects of one slice, the true ones all movers in sight, over scored pixels.

    iou:          (P, T) intersection over union.
    predicted_px: (P,) areas; names, score: as in `Instances`.
    true_px:      (T,) areas; true_names: the ids of the movers.
    """

    iou: NDArray[np.float64]
    predicted_px: Ints
    names: Ints
    score: NDArray[np.float64]
    true_px: Ints
    true_names: Ints


def instances_of(ids: NDArray[np.int32], probability: NDArray[np.float32] | None, scored: Mask) -> Instances:
    """The objects of a map of ids (H, W), as far as they lie on scored pixels.

    The score of each is its mean probability; 1 where there is no probability.
    """
    inside = np.where(scored, ids, 0)
    names, labels = np.unique(inside, return_inverse=True)
    labels = labels.reshape(ids.shape).astype(np.int32)
    if not len(names) or names[0] != 0:
        labels += 1
    else:
        names = names[1:]
    return Instances(labels, names.astype(np.int64), _mean_score(labels, len(names), probability))


def connected(mask: Mask, probability: NDArray[np.float32] | None, scored: Mask) -> Instances:
    """The connected regions (eight neighbours) of a mask (H, W), for masks that tell no objects apart."""
    count, labels = cv2.connectedComponents((mask & scored).astype(np.uint8), connectivity=8)
    numbered = labels.astype(np.int32)
    return Instances(numbered, np.arange(1, count, dtype=np.int64), _mean_score(numbered, count - 1, probability))


def _mean_score(labels: NDArray[np.int32], count: int, probability: NDArray[np.float32] | None) -> NDArray[np.float64]:
    if probability is None:
        return np.ones(count)
    area_px = np.bincount(labels.ravel(), minlength=count + 1)[1:]
    return np.bincount(labels.ravel(), probability.ravel(), minlength=count + 1)[1:] / area_px


def overlaps(instances: Instances, sample: LabelledSlice) -> Overlaps:
    """Every predicted object with every mover in sight."""
    column = np.zeros(256, np.int64)
    true_names = np.array([mover.id for mover in sample.movers], np.int64)
    column[true_names] = np.arange(1, len(true_names) + 1)
    wide, high = len(true_names) + 1, len(instances.names) + 1
    at = instances.labels.astype(np.int64) * wide + column[sample.truth.ids]
    shared = np.bincount(at[sample.scored], minlength=high * wide).reshape(high, wide)
    predicted_px, true_px, cut = shared[1:].sum(axis=1), shared[:, 1:].sum(axis=0), shared[1:, 1:]
    iou = cut / np.maximum(predicted_px[:, None] + true_px[None, :] - cut, 1)
    return Overlaps(iou, predicted_px, instances.names, instances.score, true_px, true_names)


def matched_scores(pairs: Overlaps) -> Scores:
    """Mean overlap of movers of at least 30 pixels, each with the predicted object that the best assignment gives it.

    `instance_iou` counts a mover without one as 0, `instance_iou_matched` leaves it out.
    """
    iou = pairs.iou[:, pairs.true_px >= SMALL_AREA_PX]
    iou = iou[(iou > 0).any(axis=1)]
    rows = best_assignment(iou)
    best = iou[rows[rows >= 0], np.flatnonzero(rows >= 0)]
    best = best[best > 0]
    scores: Scores = {}
    if iou.shape[1]:
        scores["instance_iou"] = Score(float(best.sum()), iou.shape[1])
    if len(best):
        scores["instance_iou_matched"] = Score(float(best.sum()), len(best))
    return scores


class Identities:
    """Follows the names of predicted objects through the slices of one recording, for identity switches."""

    def __init__(self) -> None:
        self._last: dict[int, int] = {}

    def scores(self, pairs: Overlaps) -> Scores:
        """Count the movers that are called otherwise than when they were last found; found is overlap above one half.

        Only movers of at least 30 pixels count. The ratio is switches over finds.
        """
        rows, columns = np.nonzero((pairs.iou > SAME) & (pairs.true_px >= SMALL_AREA_PX))
        switches = 0
        for true, name in zip(pairs.true_names[columns].tolist(), pairs.names[rows].tolist(), strict=True):
            switches += self._last.get(true, name) != name
            self._last[true] = name
        return {"identity_switches": Score(switches, len(rows))} if len(rows) else {}
