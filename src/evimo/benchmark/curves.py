"""How scores depend on something: on the threshold of a mask, on depth, on how fast the camera turns and moves."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from evimo.evaluation import metrics
from evimo.evaluation.labels import LabelledSlice
from evimo.evaluation.metrics import Floats
from evimo.evaluation.ratios import Score, Scores
from evimo.evaluation.scores import at_rest, depth_scale
from evimo.recordings.prediction import Prediction

PRECISION, RECALL = "precision", "recall"
DEPTH, TURNING, SPEED = "AbsRel over depth", "RRE over turning", "AEE over speed"
LEVELS = 50
"""Thresholds of a mask's probability, evenly from 0 to 1."""
DEPTH_EDGES_M = (0.3, 0.5, 0.7, 0.9, 1.2, 1.6, 2.2, 3.0, 4.5)
TURNING_EDGES = (0.0, 0.1, 0.2, 0.4, 0.7, 1.1, 1.7, 2.6, 4.0)
"""rad/s"""
SPEED_EDGES = (0.05, 0.1, 0.2, 0.35, 0.55, 0.8, 1.2, 1.8)
"""m/s"""
EDGES = {DEPTH: DEPTH_EDGES_M, TURNING: TURNING_EDGES, SPEED: SPEED_EDGES}
"""Of bins; the first and the last one also hold everything beyond their outer edges."""


def curves_of(prediction: Prediction, sample: LabelledSlice) -> dict[str, Scores]:
    """What one slice adds to every curve that the prediction says something for."""
    found: dict[str, Scores] = {}
    if prediction.probability is not None:
        found |= mask_curves(prediction.probability, sample)
    metres = None
    if prediction.rel_depth is not None:
        found[DEPTH] = depth_curve(prediction.rel_depth, sample)
        metres = depth_scale(prediction.rel_depth, sample)
    if prediction.ego is not None:
        found |= motion_curves(prediction.ego, sample, metres=metres)
    return found


def mask_curves(probability: Floats, sample: LabelledSlice) -> dict[str, Scores]:
    """Precision and recall of "moving is above k / LEVELS", over scored pixels of all slices, by k."""
    level = np.clip(np.ceil(probability[sample.scored] * LEVELS).astype(np.int64), 0, LEVELS)  # above (level - 1)
    true = sample.moving[sample.scored]
    hits, called = (_at_least(np.bincount(each, minlength=LEVELS + 1)) for each in (level[true], level))
    movers = int(np.count_nonzero(true))
    return {
        PRECISION: {str(k): Score(int(hits[k + 1]), int(called[k + 1])) for k in range(LEVELS)},
        RECALL: {str(k): Score(int(hits[k + 1]), movers) for k in range(LEVELS)},
    }


def _at_least(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.cumsum(counts[::-1])[::-1]


def depth_curve(rel_depth: Floats, sample: LabelledSlice) -> Scores:
    """Relative error over pixels by true depth, the frame's median scale; samples are slices."""
    known = sample.scored & sample.truth.valid & (sample.truth.depth > 0)
    if not known.any():
        return {}
    true = sample.truth.depth[known].astype(np.float64)
    error = np.abs(rel_depth[known] * metrics.median_scale(rel_depth[known], true) - true) / true
    at = _bins(true, DEPTH_EDGES_M)
    sums, counts = np.bincount(at, error), np.bincount(at)
    return {str(k): Score(float(sums[k]), int(counts[k])) for k in np.flatnonzero(counts)}


def motion_curves(ego: Floats, sample: LabelledSlice, *, metres: float | None) -> dict[str, Scores]:
    """Errors of a twist (6,): of its rotation by how fast the camera turns, of its velocity by how fast it moves.

    The velocity is scaled by depth where there is one: the true norm would hide errors of its length.
    """
    true_velocity, true_rotation = sample.truth.ego[:3], sample.truth.ego[3:]
    rre = float(metrics.rotation_error(ego[3:], true_rotation, dt_s=sample.dt_s))
    found = {TURNING: _in_bin(float(np.linalg.norm(true_rotation)), TURNING_EDGES, rre)}
    if metres is not None and not at_rest(sample):
        aee = float(metrics.endpoint_error(ego[:3] * metres, true_velocity))
        found[SPEED] = _in_bin(float(np.linalg.norm(true_velocity)), SPEED_EDGES, aee)
    return found


def _in_bin(value: float, edges: Sequence[float], error: float) -> Scores:
    return {str(_bins(value, edges)): Score(error, 1)} if np.isfinite(value) else {}


def _bins(values: Floats | float, edges: Sequence[float]) -> NDArray[np.intp]:
    """Which bin each value is in."""
    return np.searchsorted(edges[1:-1], values, side="right")
