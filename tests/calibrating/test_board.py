"""A board: corners found in a drawn picture, the hand-eye problem, and a whole calibration with planted truth."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evimo.calibrating.board import calibrate_with_board, find_corners, hand_eye
from evimo.calibrating.fitting import Free
from evimo.calibrating.rigid import angle_between, inverse, moved, pose
from evimo.calibrating.targets import BoardTarget
from evimo.errors import BadInput
from evimo.geometry.camera import Camera

BOARD = BoardTarget("board", 7, 5, 0.05)
BLANK = Camera(250.0, 250.0, 172.5, 129.5, 260, 346, (0.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize(("columns", "rows", "quarters"), [(7, 5, (0, 2)), (6, 4, (0, 2)), (4, 4, (0, 1, 2, 3))])
def test_what_was_planted_is_found(columns, rows, quarters, known):
    """The board hangs on the body of the wand; its corners are projected by OpenCV, and found in any order."""
    rng = np.random.default_rng(8)
    board = BoardTarget("board", columns, rows, 0.05)
    times_us = np.arange(0.5e6, 12.5e6, 60_000) + 31.0
    body_from_board = known.body_from_wand @ pose(np.eye(3), np.array((-0.15, -0.1, 0.0)))
    corners = [
        known.pixels(moved(each, board.corners)) + rng.normal(0, 0.15, (columns * rows, 2))
        for each in known.cam_from_wand(times_us) @ inverse(known.body_from_wand) @ body_from_board
    ]
    in_view = [
        np.rot90(each.reshape(rows, columns, 2), rng.choice(quarters)).reshape(-1, 2)
        if ((each > 0) & (each < (345, 259))).all()
        else None
        for each in corners
    ]
    fit, found = calibrate_with_board(
        in_view, times_us, board, known.mocap(rng), start=BLANK, free=Free(), search_us=100_000
    )
    made = fit.calibration
    assert np.linalg.norm(made.rig_from_cam[:3, 3] - known.rig_from_cam[:3, 3]) < 0.001
    assert np.degrees(angle_between(made.rig_from_cam, known.rig_from_cam)) < 0.05
    assert abs(made.offset_us - known.offset_us) < 200
    middle = board.corners.mean(axis=0)  # which is where it is, whichever way round the first image had the board
    assert np.linalg.norm(moved(made.body_from_target, middle) - moved(body_from_board, middle)) < 0.001
    assert len(found) >= columns * rows * 20


def test_hand_eye_is_exact_without_noise_and_says_when_it_cannot_be():
    rng = np.random.default_rng(9)
    rig_from_cam, body_from_board = (pose(Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)) for _ in range(2))
    rig_from_body = pose(Rotation.random(8, rng=rng).as_matrix(), rng.normal(size=(8, 3)))
    cam_from_board = inverse(rig_from_cam) @ rig_from_body @ body_from_board
    found = hand_eye(cam_from_board, rig_from_body)
    assert np.allclose(found[0], rig_from_cam) and np.allclose(found[1], body_from_board)
    turning = pose(Rotation.from_rotvec(np.outer(np.linspace(0, 2, 8), (0, 0, 1))).as_matrix(), rng.normal(size=(8, 3)))
    with pytest.raises(BadInput, match="do not tell"):
        hand_eye(inverse(rig_from_cam) @ turning @ body_from_board, turning)


def test_corners_are_those_of_the_drawn_board():
    picture = np.full((260, 346), 255, np.uint8)
    for row in range(6):
        for column in range(8):
            if (row + column) % 2 == 0:
                corner = (60 + 28 * column, 40 + 28 * row)
                cv2.rectangle(picture, corner, (corner[0] + 27, corner[1] + 27), 0, -1)
    found = find_corners(cv2.GaussianBlur(picture, (3, 3), 0), BOARD)
    x, y = np.meshgrid(87.5 + 28 * np.arange(7), 67.5 + 28 * np.arange(5))
    expected = np.stack((x.ravel(), y.ravel()), axis=1)
    assert found is not None
    assert min(np.abs(found - expected).max(), np.abs(found[::-1] - expected).max()) < 0.1
    assert find_corners(np.zeros((260, 346), np.uint8), BOARD) is None
