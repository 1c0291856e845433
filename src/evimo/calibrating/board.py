"""A camera calibrated with a board of squares that motion capture tracks, its place on its body unknown."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from evimo.calibrating.board_turns import Turns, turns_of
from evimo.calibrating.fitting import Calibration, Fit, Free, fit_calibration
from evimo.calibrating.rigid import angle_between, nearest_rotation, pose
from evimo.calibrating.sightings import Mocap, Sightings
from evimo.calibrating.targets import BoardTarget
from evimo.errors import BadInput
from evimo.geometry.camera import Camera

F8 = NDArray[np.float64]

FEWEST_IMAGES = 8
FINDING = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_NORMALIZE_IMAGE
STEP_US = 5_000.0
DETERMINED = 1e-4  # of the equations of rotation; below, another camera fits as well
FAR = 5  # images between two whose rotations are compared


def find_corners(image: NDArray[np.uint8], board: BoardTarget) -> F8 | None:
    """The board's inner corners (columns * rows, 2), px, in the order of `board.corners`; None where it is not seen."""
    found, corners = cv2.findChessboardCornersSB(image, (board.columns, board.rows), flags=FINDING)
    return corners.reshape(-1, 2).astype(np.float64) if found else None


def calibrate_with_board(
    corners: Sequence[F8 | None],
    times_us: F8,
    board: BoardTarget,
    mocap: Mocap,
    *,
    start: Camera,
    free: Free,
    search_us: float = 0.0,
) -> tuple[Fit, Sightings]:
    """The camera's place on the rig from images of a board; and the sightings of its corners.

    Args:
        corners: of each image, as `find_corners` gives them.
        times_us: of the images (F,), camera's clock.
        board: its corners.
        mocap: where the rig and the board were.
        start: size and lens; its intrinsics are kept if `free` does not fit them, and found anew if it does.
        free: what is fitted beside the place on the rig; the board's place on its body always is.
        search_us: how far the camera's clock may be from mocap's, to either side.

    Raises:
        BadInput: the board was found in too few images, or turned too little.
    """  # fmt: skip
    images, px = _found(corners)
    camera, cam_from_board = _views(px, board, start, free)
    turns, seen_us = turns_of(board), times_us[images]
    offset_us = _offset(cam_from_board, turns, seen_us, mocap, search_us=search_us) if free.clock else 0.0
    rig_from_body, known = mocap.rig_from_target(seen_us - offset_us)
    if known.sum() < FEWEST_IMAGES:
        raise BadInput(f"mocap knows {int(known.sum())} of the images' times", fix="the right clock, a wider --search")
    ways = turns.as_before(cam_from_board[known], rig_from_body[known])
    turned = cam_from_board[known] @ turns.board_from_turned[ways]
    rig_from_cam, body_from_board = hand_eye(turned, rig_from_body[known])
    begin = Calibration(camera=camera, rig_from_cam=rig_from_cam, body_from_target=body_from_board, offset_us=offset_us)
    px = np.take_along_axis(px[known], turns.orders[ways][..., None], axis=1).reshape(-1, 2)
    points = np.tile(board.corners, (len(ways), 1))
    found = Sightings(times_us, np.repeat(images[known], len(board.corners)), points, px)
    return fit_calibration(begin, found, mocap, free), found


def hand_eye(cam_from_board: F8, rig_from_body: F8) -> tuple[F8, F8]:
    """Where the camera is on the rig and the board on its body (4, 4), from both views of many moments (F, 4, 4).

    Raises:
        BadInput: they do not determine it.
    """
    count = len(cam_from_board)
    board_turn, body_turn = cam_from_board[:, :3, :3], rig_from_body[:, :3, :3]
    # rig_from_cam @ cam_from_board = rig_from_body @ body_from_board: linear in both unknown rotations, row by row.
    rows = np.zeros((count, 9, 18))
    rows[:, :, :9] = np.einsum("ik,njl->nilkj", np.eye(3), board_turn).reshape(count, 9, 9)
    rows[:, :, 9:] = -np.einsum("nik,jl->niljk", body_turn, np.eye(3)).transpose(0, 1, 2, 4, 3).reshape(count, 9, 9)
    values, ways = np.linalg.eigh(np.einsum("nri,nrj->ij", rows, rows))
    if values[1] < DETERMINED * values[-1]:
        raise BadInput("the views do not tell where the camera is", fix="turn the board or the rig about all axes")
    both = ways[:, 0].reshape(2, 3, 3)
    cam_turn, own_turn = (nearest_rotation(each) for each in both * np.sign(np.linalg.det(both[0])))
    places = np.concatenate((np.broadcast_to(np.eye(3), (count, 3, 3)), -body_turn), axis=2).reshape(-1, 6)
    known = rig_from_body[:, :3, 3] - cam_from_board[:, :3, 3] @ cam_turn.T
    solved = np.asarray(np.linalg.lstsq(places, known.ravel(), rcond=None)[0], np.float64)
    return pose(cam_turn, solved[:3]), pose(own_turn, solved[3:])


def _found(corners: Sequence[F8 | None]) -> tuple[NDArray[np.int64], F8]:
    """The images (F,) in which the board was found, and its corners there (F, K, 2), px."""
    images = [image for image, each in enumerate(corners) if each is not None]
    if len(images) < FEWEST_IMAGES:
        raise BadInput(
            f"the board was found in {len(images)} of {len(corners)} images",
            fix=f"{FEWEST_IMAGES} and more, and the right count of inner corners",
        )
    return np.array(images), np.array([each for each in corners if each is not None])


def _views(px: F8, board: BoardTarget, start: Camera, free: Free) -> tuple[Camera, F8]:
    """The camera, and where the board was in front of it in each image (F, 4, 4)."""
    if free.intrinsics and start.lens == "radtan":
        points = [board.corners.astype(np.float32)] * len(px)
        matrix = np.array(((start.fx, 0, start.cx), (0, start.fy, start.cy), (0, 0, 1)))
        found = cv2.calibrateCamera(
            points, [each.astype(np.float32) for each in px], start.size[::-1], matrix, np.zeros(5),
            flags=cv2.CALIB_FIX_K3 | cv2.CALIB_USE_INTRINSIC_GUESS,
        )  # fmt: skip
        matrix, lens = np.asarray(found[1]), tuple(map(float, np.ravel(found[2])[:4]))
        start = Camera(matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *start.size, lens)
    views: list[F8] = []
    for each in px:
        _, turn, place = cv2.solvePnP(board.corners, start.normalised(each)[0], np.eye(3), np.zeros(4))
        views.append(pose(Rotation.from_rotvec(np.ravel(turn)).as_matrix(), np.ravel(place).astype(np.float64)))
    return start, np.array(views)


def _offset(cam_from_board: F8, turns: Turns, times_us: F8, mocap: Mocap, *, search_us: float) -> float:
    """The offset under which board and body turn by the same angles; these do not depend on where either sits, µs."""
    step = min(FAR, len(times_us) - 1)
    angles = turns.angles(cam_from_board[step:], cam_from_board[:-step])
    offsets = np.arange(-search_us, search_us + STEP_US / 2, STEP_US) if search_us else np.zeros(1)
    scores: list[float] = []
    for offset_us in offsets:
        poses, known = mocap.rig_from_target(times_us - offset_us)
        both = known[step:] & known[:-step]
        turned = angle_between(poses[step:], poses[:-step])
        apart = np.abs(turned - angles).min(axis=0)
        scores.append(float(np.mean(apart[both])) if both.mean() > 0.5 else np.inf)
    if not np.isfinite(scores).any():
        raise BadInput("mocap does not know the board at the images' times", fix="the right clock, a wider --search")
    return float(offsets[int(np.argmin(scores))])
