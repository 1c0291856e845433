"""What really happened at one instant, in sensor pixels."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MOVING_MPS, MOVING_DEGPS = 0.03, 10  # what is slower rests, and counts as background, everywhere in this package


@dataclass(frozen=True, slots=True)
class ObjectTruth:
    """One object at one instant, camera axes.

    position: (3,) a point of the body, m, about which it turns.
    velocity: (3,) of that point relative to the static world, m/s.
    rotation: (3,) angular velocity relative to the static world, rad/s.
    settled:  whether it moves, where that was told from its whole path (`paths.moving_of`); else its speed tells.
    """

    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    rotation: NDArray[np.float64]
    settled: bool | None = None

    @property
    def moves(self) -> bool:
        """Whether it moves now, faster than 3 cm/s or 10 degrees/s relative to the static world; else it rests."""
        if self.settled is not None:
            return self.settled
        speed, turning = float(np.linalg.norm(self.velocity)), float(np.linalg.norm(self.rotation))
        return speed > MOVING_MPS or turning > math.radians(MOVING_DEGPS)


@dataclass(frozen=True, slots=True)
class Truth:
    """Depth, ids and motion at t_us, in sensor pixels (H, W), lens included.

    depth:   (H, W) float32, z in m.
    valid:   (H, W) bool, where depth is known.
    ids:     (H, W) uint8; 0 is static, else a key of `objects`.
    clutter: (H, W) bool, static bodies drawn from the movers' own family of shapes and textures.
    ego:     (6,) the camera's twist relative to the static world, camera axes, m/s and rad/s.
    objects: id to motion, of the objects that exist (they may be out of view, or rest).
    """

    t_us: int
    depth: NDArray[np.float32]
    valid: NDArray[np.bool_]
    ids: NDArray[np.uint8]
    clutter: NDArray[np.bool_]
    ego: NDArray[np.float64]
    objects: dict[int, ObjectTruth]

    @property
    def movers(self) -> list[int]:
        """The ids of what moves now."""
        return [key for key, body in self.objects.items() if body.moves]

    def of_movers(self, ids: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Which of some ids, of pixels or of events, are of an object that moves now."""
        return np.isin(ids, self.movers)
