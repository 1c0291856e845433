"""Scores of a motion mask by what the movers are like: how they move against the static world, how large, how new."""

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterator
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.evaluation.labels import SMALL_AREA_PX, LabelledSlice, Mover
from evimo.evaluation.metrics import Mask
from evimo.evaluation.pixel_classes import MOVING, PixelCounts
from evimo.evaluation.ratios import Score, Scores, added

RESIDUAL_EDGES_PX = (0.5, 1.0, 2.0, 4.0)
AREA_EDGES = (0.003, 0.01, 0.03)


def between_edges(edges: tuple[float, ...], unit: str) -> tuple[str, ...]:
    """Every interval of so many edges in words, each with its lower edge and without its upper one."""
    middle = (f"{low:g}–{high:g}" for low, high in pairwise(edges))
    return tuple(f"{words} {unit}" for words in (f"<{edges[0]:g}", *middle, f"≥{edges[-1]:g}"))


RESIDUALS = {f"residual_{k}": words for k, words in enumerate(between_edges(RESIDUAL_EDGES_PX, "px"))}
AREAS = {f"area_{k}": words for k, words in enumerate(between_edges(tuple(100 * edge for edge in AREA_EDGES), "%"))}
FAMILIARITY = {"familiar": "familiar", "unfamiliar": "unfamiliar"}
"""Names of strata and how tables call them."""


def strata_of(mover: Mover) -> Iterator[str]:
    """The names of the strata that the mover is in, one of each kind that is known."""
    if mover.residual_px is not None:
        yield list(RESIDUALS)[bisect_right(RESIDUAL_EDGES_PX, mover.residual_px)]
    yield list(AREAS)[bisect_right(AREA_EDGES, mover.area)]
    if mover.familiar is not None:
        yield "familiar" if mover.familiar else "unfamiliar"


def mover_scores(called: Mask, sample: LabelledSlice, found: PixelCounts) -> Scores:
    """IoU, recall and detection of a mask (H, W) of scored pixels, by stratum; pixels of movers of others are left out.

    found: what its pixels are.

    So IoU of a stratum is the mean, over frames with such a mover, of the called pixels on its movers, over those
    plus its missed pixels plus all called pixels on nothing that moves.
    """
    hit, hit_active = found.of_objects()
    false_px = found.having(lacking=MOVING)
    members: dict[str, list[Mover]] = defaultdict(list)
    for mover in sample.movers:
        for name in strata_of(mover):
            members[name].append(mover)
    scores = detection_scores(called, sample)
    for name, movers in members.items():
        keys = [mover.id for mover in movers]
        union = false_px + sum(mover.area_px for mover in movers)
        scores[f"iou_{name}"] = Score(int(hit[keys].sum()) / union, 1)
        scores[f"recall_{name}"] = Score(int(hit_active[keys].sum()), sum(mover.active_px for mover in movers))
    return scores


def detection_scores(called: Mask, sample: LabelledSlice) -> Scores:
    """Share of the movers with at least 30 scored pixels that are detected, of all and by stratum.

    A mover is detected when more than half of its scored pixels lie in connected regions of the called pixels (eight
    neighbours) that lie more on this mover than off it. For a single region that is the published rule: it covers more
    than half of the mover, and more of the mover than of anything else, be that static or another mover.
    """
    covered = _covered_by_own_regions(called, sample)
    parts: list[Scores] = []
    for mover, covered_px in zip(sample.movers, covered, strict=True):
        if mover.area_px >= SMALL_AREA_PX:
            names = ("detected", *(f"detected_{name}" for name in strata_of(mover)))
            parts.append(dict.fromkeys(names, Score(int(2 * covered_px > mover.area_px), 1)))
    return added(parts)


def _covered_by_own_regions(called: Mask, sample: LabelledSlice) -> list[int]:
    """Of each mover the pixels in connected regions that lie more on it than off it."""
    if not sample.movers:
        return []
    column = np.zeros(256, np.int64)  # 0: off every mover
    column[[mover.id for mover in sample.movers]] = np.arange(1, len(sample.movers) + 1)
    count, regions = cv2.connectedComponents(called.astype(np.uint8), connectivity=8)
    wide = len(sample.movers) + 1
    at = regions[called].astype(np.int64) * wide + column[sample.truth.ids[called]]
    shared: NDArray[np.int64] = np.bincount(at, minlength=count * wide).reshape(count, wide)
    own = 2 * shared > shared.sum(axis=1, keepdims=True)
    return (shared * own).sum(axis=0)[1:].tolist()
