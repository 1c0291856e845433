"""How boards that look alike when they are turned are told apart, images far from each other included."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evimo.calibrating.board_turns import turns_of
from evimo.calibrating.rigid import inverse, pose
from evimo.calibrating.targets import BoardTarget

COUNT = 25


# In the draws 190 and 230 the first few images fit two ways, and only all of them together tell.
@pytest.mark.parametrize(("columns", "rows", "seed"), [(8, 6, 190), (5, 5, 230), (9, 6, 0), (5, 5, 1)])
def test_images_far_apart_are_all_told_alike(columns, rows, seed):
    rng = np.random.default_rng(seed)
    turns = turns_of(BoardTarget("board", columns, rows, 0.03))
    board_from_body, cam_from_rig = (pose(Rotation.random(random_state=rng).as_matrix(), np.zeros(3)) for _ in range(2))
    rig_from_body, noise = (
        pose(Rotation.from_rotvec(rng.normal(size=(COUNT, 3)) * spread).as_matrix(), np.zeros((COUNT, 3)))
        for spread in (1.0, 0.005)
    )
    cam_from_board = cam_from_rig @ rig_from_body @ inverse(board_from_body) @ noise
    planted = rng.integers(len(turns.orders), size=COUNT)
    ways = turns.as_before(cam_from_board @ inverse(turns.board_from_turned[planted]), rig_from_body)
    total = turns.board_from_turned[ways] @ inverse(turns.board_from_turned[planted])
    np.testing.assert_allclose(total, np.broadcast_to(total[0], total.shape), atol=1e-6)  # turned as the first one was
