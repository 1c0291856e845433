"""Which way round a board was found: one that looks alike when it is turned has its corners in several orders.

A board is alike upside down unless one of its counts of inner corners is even and the other odd, which finders do not
heed; a square one is on its sides, too. Which corner comes first is then the finder's choice, and another one where the
board has turned further. Motion capture tells by how much it turned between two images.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.calibrating.rigid import angle_between, inverse, pose
from evimo.calibrating.targets import BoardTarget

F8 = NDArray[np.float64]

OTHERS = 200  # images with which one is compared, at most
SWEEPS = 2  # over all images


@dataclass(frozen=True, slots=True)
class Turns:
    """The S ways in which a board can be found, the first of them as it is.

    orders: (S, K), of its K corners. board_from_turned: (S, 4, 4), the board's own pose when it is turned so.
    """

    orders: NDArray[np.int64]
    board_from_turned: F8

    def angles(self, cam_from_board: F8, before: F8) -> F8:
        """By how much the board turned since it was at `before` (F, 4, 4), if it was found each way now (S, F), rad."""
        return angle_between(before, cam_from_board @ self.board_from_turned[:, None])

    def as_before(self, cam_from_board: F8, rig_from_body: F8) -> NDArray[np.int64]:
        """The way in which each view (F, 4, 4) was found, all like the first one, by what mocap has of it (F, 4, 4)."""
        found, ways = cam_from_board.copy(), np.zeros(len(cam_from_board), np.int64)
        numbers = np.arange(len(found))
        for sweep in range(SWEEPS):  # by those before it; then again by all, of which few err
            for number in numbers[1:]:
                others = np.delete(numbers, number) if sweep else numbers[:number]
                others = others[:: len(others) // OTHERS + 1]
                turned = angle_between(rig_from_body[others], rig_from_body[number])
                apart = np.abs(self.angles(cam_from_board[number], found[others]) - turned).mean(axis=1)
                ways[number] = np.argmin(apart)
                found[number] = cam_from_board[number] @ self.board_from_turned[ways[number]]
        return ways


def turns_of(board: BoardTarget) -> Turns:
    """The turns of a board in its plane that leave its corners where they are."""
    numbers = np.arange(len(board.corners)).reshape(board.rows, board.columns)
    quarters = (0, 1, 2, 3) if board.rows == board.columns else (0, 2)
    orders = np.stack([np.rot90(numbers, quarter).ravel() for quarter in quarters])
    middle = board.corners.mean(axis=0)
    angles = 0.5 * np.pi * np.array(quarters)
    cos, sin, zero = np.cos(angles), np.sin(angles), np.zeros(len(angles))
    turn = np.stack((cos, -sin, zero, sin, cos, zero, zero, zero, zero + 1), axis=1).reshape(-1, 3, 3)
    about_origin = pose(turn, np.zeros((len(angles), 3)))
    shift = pose(np.eye(3), middle)
    return Turns(orders, shift @ about_origin @ inverse(shift))
