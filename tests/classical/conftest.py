"""Events of scenes whose geometry is known: points on planes before a camera that really moves."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evimo.classical.world import Scene

SIZE = (260, 346)
FOCAL_PX = 260.0
CENTRE = (172.5, 129.5)
SLICE_S = 0.025


@dataclass(frozen=True)
class Body:
    """Straight edges on the plane Z = 1 within a box (x0, y0, x1, y1) of the picture, seen by a camera of that twist.

    twist: (6,) of the camera relative to the body, in mean depths/s and rad/s. edges: how many; events: on all of them.
    """

    twist: tuple[float, ...]
    edges: int = 80
    events: int = 30_000
    box: tuple[float, float, float, float] = (-60.0, -60.0, 406.0, 320.0)

    def pictured(self, points: np.ndarray, t_s: np.ndarray) -> np.ndarray:
        """Where points (N, 2) px of the picture at time 0 are at their times, (N, 2) px: a rigid motion, projected."""
        at = np.column_stack(((points - CENTRE) / FOCAL_PX, np.ones(len(points))))
        velocity, rate = np.array(self.twist[:3]), np.array(self.twist[3:])
        turned = Rotation.from_rotvec(-rate * t_s[:, None]).apply(at - velocity * t_s[:, None])
        return turned[:, :2] / turned[:, 2:] * FOCAL_PX + CENTRE

    def flow(self, points: np.ndarray) -> np.ndarray:
        """Px per slice at points (N, 2), by a small step of time."""
        step_s = np.full(len(points), 1e-5)
        return (self.pictured(points, step_s) - self.pictured(points, -step_s)) / 2e-5 * SLICE_S

    def events_of(self, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Places (N, 2) px, whole pixels, and times (N,) in slices, within one and a half of the centre."""
        x0, y0, x1, y1 = self.box
        middle = random.uniform((x0, y0), (x1, y1), (self.edges, 2))
        angle, length = random.uniform(0, np.pi, self.edges), random.uniform(10, 50, self.edges)
        edge, along = random.integers(0, self.edges, self.events), random.uniform(-0.5, 0.5, self.events)
        points = middle[edge] + (along * length[edge])[:, None] * np.column_stack((np.cos(angle), np.sin(angle)))[edge]
        points = points[((points >= (x0, y0)) & (points <= (x1, y1))).all(axis=1)]
        t = random.uniform(-1.0, 1.0, len(points))
        return np.rint(self.pictured(points, t * SLICE_S)), t


@pytest.fixture
def scene_of() -> Callable[..., Scene]:
    """`scene_of(body, …, noise=, seed=)`: the events of those bodies in one picture; the last ones hide the first."""

    def made(*bodies: Body, noise: int = 500, seed: int = 0) -> Scene:
        random = np.random.default_rng(seed)
        places, times = np.zeros((0, 2)), np.zeros(0)
        for body in bodies:
            if len(places):  # what the nearer body hides: its box, moved as it moves
                x0, y0, x1, y1 = body.box
                home = places - body.flow(np.array([[(x0 + x1) / 2, (y0 + y1) / 2]])) * times[:, None]
                hidden = ((home >= (x0, y0)) & (home <= (x1, y1))).all(axis=1)
                places, times = places[~hidden], times[~hidden]
            own, when = body.events_of(random)
            places, times = np.concatenate((places, own)), np.concatenate((times, when))
        places = np.concatenate((places, random.integers(0, SIZE[::-1], (noise, 2))))
        times = np.concatenate((times, random.uniform(-1, 1, noise)))
        seen = ((places >= 0) & (places < SIZE[::-1])).all(axis=1)
        order = np.argsort(times[seen])
        x, y, t = (each[seen][order].astype(np.float32) for each in (places[:, 0], places[:, 1], times))
        return Scene(x, y, t, SIZE, CENTRE)

    return made


@pytest.fixture
def body() -> type[Body]:
    return Body
