"""What geometry allows: scores of the true flow itself, called moving where no static point could move like that.

An estimate above "true flow, depth unknown" has learned what things look like, or how far away they are; one below it
has flow or camera motion to gain. Neither ceiling bounds a network strictly.
"""

import numpy as np
from numpy.typing import NDArray

from evimo.evaluation.labels import LabelledSlice, Residual
from evimo.evaluation.ratios import Scores
from evimo.evaluation.scores import mask_scores
from evimo.recordings.flow import point_flow
from evimo.recordings.truth import Truth

F8 = NDArray[np.float64]

THRESHOLDS_PX = (0.1, 0.3, 0.5, 1.0)
THRESHOLD_PX = 0.3
"""Per slice; what a good flow can be trusted to. Chosen, not tuned: all four are printed by bench/populations.py."""
NEAREST_M = 0.3

TRUE_FLOW = "true flow"
DEPTH_UNKNOWN = "true flow, depth unknown"
ROWS = (TRUE_FLOW, DEPTH_UNKNOWN)
"""In the order of the tables."""


def residual_motion(
    truth: Truth, flow: NDArray[np.floating], grid: F8, *, px_per_slice: tuple[float, float]
) -> Residual:
    """How far the flow of each pixel differs from that of the static world, with its depth known and unknown.

    A static point at depth Z flows by rotation + translation / Z (paper, eq. 1): with Z unknown, anywhere on a segment
    along its epipolar line, from Z infinite to `NEAREST_M`. The distance is to that segment.

    Args:
        flow: (2, H, W), 1/s on the plane Z = 1.
        grid: (2, H, W), x and y of each pixel there, the lens taken out.
        px_per_slice: focal lengths (fx, fy) times the slice's length.
    """
    per_slice = np.reshape(px_per_slice, (2, 1, 1))
    turning = static_part(np.append(np.zeros(3), truth.ego[3:]), grid) * per_slice
    passing = static_part(np.append(truth.ego[:3], np.zeros(3)), grid) * per_slice  # of a point at 1 m
    known = truth.valid & (truth.depth > 0)
    left = np.where(known, flow * per_slice - turning, 0)
    square = (passing**2).sum(axis=0)
    nearness = np.divide((left * passing).sum(axis=0), square, out=np.zeros(square.shape), where=square > 0)
    nearest = np.hypot(*(left - nearness.clip(0, 1 / NEAREST_M) * passing))
    inverse = np.divide(1, truth.depth, out=np.zeros(square.shape), where=known)
    return Residual(np.hypot(*(left - inverse * passing)).astype(np.float32), nearest.astype(np.float32), known)


def static_part(ego: F8, grid: F8) -> F8:
    """Flow (2, H, W) in 1/s of static points at 1 m, seen by a camera with that twist (6,)."""
    points = grid.reshape(2, -1)
    ones = np.ones(points.shape[1])
    return point_flow(points, ones.astype(np.float32), ones.astype(np.uint8), (ego, {})).reshape(grid.shape)


def ceiling_scores(sample: LabelledSlice, *, threshold_px: float = THRESHOLD_PX) -> dict[str, Scores]:
    """Mask scores of "differs by more than so many px per slice", by the name of the row; none without true flow."""
    residual = sample.residual
    if residual is None:
        return {}
    maps = {TRUE_FLOW: residual.depth_known, DEPTH_UNKNOWN: residual.depth_unknown}
    return {row: mask_scores(residual.valid & (distance > threshold_px), sample) for row, distance in maps.items()}
