"""Residual motion against cameras that are really moved, and the scores of the true flow on the hand-made world."""

from dataclasses import replace

import numpy as np
import pytest
from pytest import approx
from scipy.spatial.transform import Rotation

from evimo.evaluation.ceilings import DEPTH_UNKNOWN, NEAREST_M, TRUE_FLOW, ceiling_scores, residual_motion
from evimo.evaluation.labels import Residual
from evimo.recordings.truth import Truth

PX = (100 * 0.025, 200 * 0.025)  # focal lengths of 100 and 200 px, slices of 25 ms
GRID = np.stack(np.meshgrid(np.linspace(-0.4, 0.4, 5), np.linspace(-0.3, 0.3, 4)))
DEPTH = np.linspace(0.5, 4, 20, dtype=np.float32).reshape(4, 5)
EGO = np.array([0.2, -0.1, 0.3, 0.2, 0.5, -0.4])


def truth_of(ego, depth=DEPTH, valid=None) -> Truth:
    valid = np.ones(depth.shape, bool) if valid is None else valid
    return Truth(0, depth, valid, np.zeros(depth.shape, np.uint8), np.zeros(depth.shape, bool), ego, {})


def seen_by_moving(ego, depth):
    """Flow of static points: the camera is really moved there and back by 10 microseconds."""

    def seen_after(dt_s):
        points = np.moveaxis(np.stack((*(GRID * depth), depth)), 0, -1).astype(float)
        there = Rotation.from_rotvec(ego[3:] * dt_s).inv().apply((points - ego[:3] * dt_s).reshape(-1, 3))
        return (there[:, :2] / there[:, 2:]).T.reshape(2, *depth.shape)

    return (seen_after(1e-5) - seen_after(-1e-5)) / 2e-5


def test_what_stands_still_has_no_residual_motion_at_its_depth_nor_at_any():
    residual = residual_motion(truth_of(EGO), seen_by_moving(EGO, DEPTH), GRID, px_per_slice=PX)
    assert residual.depth_known == approx(np.zeros((4, 5)), abs=1e-5)
    assert residual.depth_unknown == approx(np.zeros((4, 5)), abs=1e-5)
    assert residual.valid.all()


def test_a_static_point_at_another_depth_is_only_found_where_depth_is_known():
    residual = residual_motion(truth_of(EGO), seen_by_moving(EGO, DEPTH * 2), GRID, px_per_slice=PX)
    assert (residual.depth_known > 0.05).all()
    assert residual.depth_unknown == approx(np.zeros((4, 5)), abs=1e-5)


@pytest.mark.parametrize(
    ("flow_x", "flow_y", "known", "unknown"),
    [
        (-0.2, 0.0, 0.0, 0.0),  # a static point at 1 m: the camera goes right, the point goes left
        (-0.1, 0.0, 0.25, 0.0),  # 0.1/s short of that, 2.5 px a slice per 1/s: may be static at 2 m
        (-2 / 3, 0.0, 2.5 * (2 / 3 - 0.2), 0.0),  # 0.3 m away, just allowed
        (-1.0, 0.0, 2.0, 2.5 * (1 - 0.2 / NEAREST_M)),  # nearer than 0.3 m
        (0.1, 0.0, 0.75, 0.25),  # goes with the camera: behind infinity
        (-0.2, 0.1, 0.5, 0.5),  # off the line by 0.1/s in y, 5 px a slice per 1/s
        (0.1, 0.1, np.hypot(0.75, 0.5), np.hypot(0.25, 0.5)),
    ],
)
def test_beside_a_sliding_camera_residual_motion_is_the_distance_to_a_segment(flow_x, flow_y, known, unknown):
    depth = np.ones((4, 5), np.float32)
    flow = np.stack((np.full((4, 5), flow_x), np.full((4, 5), flow_y)))
    residual = residual_motion(truth_of(np.array([0.2, 0, 0, 0, 0, 0]), depth), flow, GRID, px_per_slice=PX)
    assert residual.depth_known == approx(np.full((4, 5), known), abs=1e-6)
    assert residual.depth_unknown == approx(np.full((4, 5), unknown), abs=1e-6)


def test_before_a_camera_that_only_turns_depth_does_not_matter():
    ego = np.array([0, 0, 0, 0.2, 0.5, -0.4])
    flow = seen_by_moving(ego, DEPTH) + np.reshape([0.3, 0.4], (2, 1, 1))
    residual = residual_motion(truth_of(ego), flow, GRID, px_per_slice=(10, 10))
    assert residual.depth_known == approx(np.full((4, 5), 5.0), abs=1e-5)
    assert residual.depth_unknown == approx(np.full((4, 5), 5.0), abs=1e-5)


def test_nothing_is_said_where_depth_is_unknown():
    valid = DEPTH > 1
    residual = residual_motion(
        truth_of(EGO, np.where(valid, DEPTH, 0).astype(np.float32), valid), np.ones((2, 4, 5)), GRID, px_per_slice=PX
    )
    assert (residual.valid == valid).all()


def test_ceilings_call_moving_what_exceeds_the_threshold(sample, box):
    known = np.where(box(1, 3, 1, 3), 0.4, 0.2).astype(np.float32)  # four of the mover's six pixels
    unknown = np.where(box(1, 3, 1, 2), 0.4, 0.2).astype(np.float32)  # two of them
    rows = ceiling_scores(replace(sample, residual=Residual(known, unknown, np.ones(known.shape, bool))))
    assert rows[TRUE_FLOW]["iou"].value == approx(4 / 6)
    assert rows[DEPTH_UNKNOWN]["iou"].value == approx(2 / 6)
    finer = ceiling_scores(replace(sample, residual=Residual(known, unknown, box(0, 6, 0, 4))), threshold_px=0.1)
    assert finer[TRUE_FLOW]["iou"].value == approx(6 / 24)  # everything whose depth is known
    assert ceiling_scores(sample) == {}
