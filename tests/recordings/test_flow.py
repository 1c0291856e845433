"""True flow against the scene moved a little and seen again."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evimo.recordings.flow import true_flow
from evimo.recordings.truth import ObjectTruth, Truth

STEP_S = 1e-5
EGO = np.array([0.3, -0.2, 0.5, 0.4, -0.7, 0.9])
MOVED = ObjectTruth(np.array([0.2, -0.1, 1.5]), np.array([-0.6, 0.3, 0.2]), np.array([1.5, -2.0, 0.7]))


@pytest.fixture
def grid():
    return np.stack(np.meshgrid(np.linspace(-0.6, 0.6, 7), np.linspace(-0.4, 0.4, 5)))


def truth(ids, ego=EGO, moved=MOVED):
    depth = np.random.default_rng(0).uniform(0.8, 3, ids.shape).astype(np.float32)
    nowhere = np.zeros(ids.shape, bool)
    return Truth(0, depth, ~nowhere, ids, nowhere, ego, {1: moved})


def seen_after(grid, known, step_s):
    """Where each pixel's point is on Z = 1 when, for step_s, the object and then the camera have moved."""
    points = np.concatenate((grid, np.ones_like(grid[:1]))).reshape(3, -1).T * known.depth.reshape(-1, 1)
    turn = Rotation.from_rotvec(MOVED.rotation * step_s)
    carried = turn.apply(points - MOVED.position) + MOVED.position + MOVED.velocity * step_s
    points = np.where(known.ids.reshape(-1, 1) == 1, carried, points)
    camera_turn = Rotation.from_rotvec(known.ego[3:] * step_s)
    points = camera_turn.inv().apply(points - known.ego[:3] * step_s)
    return (points[:, :2] / points[:, 2:]).T.reshape(grid.shape)


def test_flow_is_what_a_moving_camera_sees_of_moving_objects(grid):
    known = truth((np.arange(35).reshape(5, 7) % 2).astype(np.uint8))
    expected = (seen_after(grid, known, STEP_S) - seen_after(grid, known, -STEP_S)) / (2 * STEP_S)
    np.testing.assert_allclose(true_flow(known, grid), expected, atol=1e-6)


def test_what_stands_still_does_not_flow(grid):
    known = truth(np.zeros((5, 7), np.uint8), ego=np.zeros(6))
    assert not true_flow(known, grid).any()


def test_an_object_that_moves_with_the_camera_does_not_flow(grid):
    with_it = ObjectTruth(np.zeros(3), EGO[:3], EGO[3:])
    np.testing.assert_allclose(true_flow(truth(np.ones((5, 7), np.uint8), moved=with_it), grid), 0, atol=1e-12)


def test_unknown_depth_has_no_flow(grid):
    known = truth(np.ones((5, 7), np.uint8))
    known.valid[2, 3], known.depth[2, 3] = False, 0
    flow = true_flow(known, grid)
    assert not flow[:, 2, 3].any()
    assert np.isfinite(flow).all()
    assert flow[:, 0, 0].all()
