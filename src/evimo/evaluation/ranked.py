"""Scores for which all slices must first be put in order: average precision, and the best 30 % of the frames."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadInput
from evimo.evaluation.instances import Overlaps
from evimo.evaluation.labels import SMALL_AREA_PX
from evimo.evaluation.ratios import Score, Scores

BEST_SHARE = 0.3
THRESHOLDS = np.linspace(0.5, 0.95, 10)  # COCO's
RECALLS = np.linspace(0, 1, 101)  # COCO's
MOST_DETECTIONS = 100  # per slice, COCO's
LARGE_PX = 400
"""Slices with fewer moving pixels are left out by EvInsMOS."""
IN_LARGE = 1 << 20  # bit of a detection in a slice with at least that many
ALL_IGNORED = 0x3FF << 10
TINY = 1e-10  # so that an overlap of just the threshold is enough, whatever its rounding
NAMES = ("iou_best30", "ap", "ap50", "ap_evinsmos")


@dataclass(frozen=True, slots=True)
class Ranked:
    """What one row of a report must remember of every slice; adds up over slices and recordings.

    frame_iou:  dense IoU of each slice in which something moves in sight.
    detections: score and bits of each predicted object: bit k, right at the k-th threshold; bit 10 + k, not counted
        there, being or finding something smaller than 30 pixels; bit 20, in a slice with at least 400 moving pixels.
    movers, movers_large: true objects of at least 30 pixels, in all slices and in those with 400 moving pixels.
    """

    frame_iou: tuple[float, ...] = ()
    detections: tuple[tuple[float, int], ...] = ()
    movers: int = 0
    movers_large: int = 0

    def __add__(self, other: "Ranked") -> "Ranked":
        return Ranked(
            self.frame_iou + other.frame_iou,
            self.detections + other.detections,
            self.movers + other.movers,
            self.movers_large + other.movers_large,
        )

    def scores(self) -> Scores:
        """The numbers, of those that can be told; they do not add up themselves."""
        scores: Scores = {}
        if self.frame_iou:
            best = sorted(self.frame_iou)[-math.ceil(BEST_SHARE * len(self.frame_iou)) :]
            scores["iou_best30"] = Score(sum(best), len(best), len(best))
        if self.movers:
            precision = precisions(self.detections, self.movers)
            scores["ap"] = Score(float(precision.mean()), 1, self.movers)
            scores["ap50"] = Score(float(precision[0]), 1, self.movers)
        if self.movers_large:
            large = [each for each in self.detections if each[1] & IN_LARGE]
            scores["ap_evinsmos"] = Score(float(precisions(large, self.movers_large).mean()), 1, self.movers_large)
        return scores

    def plain(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {
            "frame_iou": list(self.frame_iou),
            "detections": [list(each) for each in self.detections],
            "movers": self.movers,
            "movers_large": self.movers_large,
        }


def ranked_from(saved: dict[str, Any]) -> Ranked:
    """What `plain` made, read back.

    Raises:
        BadInput: it is something else.
    """
    try:
        detections = tuple((float(score), int(bits)) for score, bits in saved["detections"])
        return Ranked(tuple(map(float, saved["frame_iou"])), detections, saved["movers"], saved["movers_large"])
    except (KeyError, TypeError, ValueError) as error:
        raise BadInput(f"no ranked scores: {error}", fix="evaluate again") from error


def ranked_detections(pairs: Overlaps, *, moving_px: int) -> Ranked:
    """The predicted objects of one slice as COCO counts them, with masks for boxes and 30 pixels as the least area.

    The surest one first, each takes the free mover that it overlaps most, if by the threshold or more; one of at least
    30 pixels before smaller ones, which are neither asked for nor held against who finds them.
    """
    order = np.argsort(-pairs.score, kind="stable")[:MOST_DETECTIONS]
    iou, small = pairs.iou[order], pairs.true_px < SMALL_AREA_PX
    bits = np.where(pairs.predicted_px[order] < SMALL_AREA_PX, ALL_IGNORED, 0)
    near = np.flatnonzero((iou >= THRESHOLDS[0] - TINY).any(axis=1))
    bits[near] = 0
    for k, threshold in enumerate(THRESHOLDS):
        free = np.ones(len(small), np.bool_)
        for at in near:
            fits = free & (iou[at] >= threshold - TINY)
            fits = fits & ~small if (fits & ~small).any() else fits
            if fits.any():
                found = int(np.argmax(np.where(fits, iou[at], -1)))
                free[found] = False
                bits[at] |= (1 << k) | (int(small[found]) << (k + 10))
            elif pairs.predicted_px[order[at]] < SMALL_AREA_PX:
                bits[at] |= 1 << (k + 10)
    large = moving_px >= LARGE_PX
    detections = zip(pairs.score[order].tolist(), (bits | (IN_LARGE * large)).tolist(), strict=True)
    movers = int(np.count_nonzero(~small))
    return Ranked(detections=tuple(detections), movers=movers, movers_large=movers * large)


def precisions(detections: Sequence[tuple[float, int]], movers: int) -> NDArray[np.float64]:
    """Average precision at each of the ten thresholds (10,): the mean over 101 recalls of the best precision there.

    The best precision is that at this recall or beyond, 0 where it is never reached. Detections of one score stay in
    the order of the slices.
    """
    score, bits = (np.array(column) for column in zip(*detections, strict=True)) if detections else (np.zeros(0),) * 2
    bits = bits.astype(np.int64)[np.argsort(-score, kind="stable")]
    return np.array([_precision(bits, k, movers) for k in range(len(THRESHOLDS))])


def _precision(bits: NDArray[np.int64], k: int, movers: int) -> float:
    counted = bits[(bits >> (10 + k)) & 1 == 0]
    right = np.cumsum((counted >> k) & 1)
    if not len(right):
        return 0.0
    best = np.maximum.accumulate((right / np.arange(1, len(right) + 1))[::-1])[::-1]
    at = np.searchsorted(right / movers, RECALLS)
    return float(np.where(at < len(right), best[np.minimum(at, len(right) - 1)], 0).mean())
