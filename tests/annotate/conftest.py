"""A small simulated scene that has been captured virtually: its exact truth is known."""

import numpy as np
import pytest

from evimo.geometry.camera import Camera
from evimo.scene.bodies import BOX, CYLINDER, ELLIPSOID, GRATING, Body, Part, Scene, Surface
from evimo.scene.motion import Motion, random_rotation, wander
from evimo.scene.textures.bank import texture_bank
from evimo.simulate.plan import RecordingPlan
from evimo.simulate.recording import SimulatedRecording
from evimo.simulate.sensor import draw_sensor

BARREL = Camera(96.0, 97.0, 65.5, 50.0, 100, 130, (-0.3, 0.08, 1e-3, -5e-4))
FISHEYE = Camera(70.0, 70.0, 64.5, 49.5, 100, 130, (0.02, -0.01, 0.002, 0.0), "fisheye")


@pytest.fixture(scope="session")
def filmed() -> SimulatedRecording:
    """A room with a net and clutter, two movers, and a camera that moves and turns, 0.1 s long."""
    rng = np.random.default_rng(5)

    def part(shape, half, position, *, turned=True, **how):
        surface = Surface(int(rng.integers(2, 12)), 0.4, (0.1, 0.2), 0.1, 0.9)
        return Part(
            shape, np.array(half), np.array(position), random_rotation(rng) if turned else np.eye(3), surface, **how
        )

    def motion(position):
        return Motion(
            np.array(position, float), random_rotation(rng), (wander(rng, 0.5, (0.5, 2.0)),), wander(rng, 2.0, (0.5, 2))
        )

    room = Body(
        (
            part(BOX, (2.0, 1.5, 3.0), (0, 0, 0), turned=False, inside=True),
            part(GRATING, (0.5, 0.4, 0.01), (-0.5, 0.2, 1.8), openings=(4.0, 3.0, 0.4, 0.3)),
        )
    )
    clutter = Body((part(CYLINDER, (0.15, 0.15, 0.3), (0.6, 0.3, 1.7)),), clutter=True)
    movers = (
        Body(
            (part(BOX, (0.2, 0.1, 0.15), (0, 0, 0)), part(ELLIPSOID, (0.1, 0.2, 0.1), (0.2, 0, 0))), motion((0, 0, 1.3))
        ),
        Body((part(CYLINDER, (0.1, 0.14, 0.2), (0, 0.05, 0)),), motion((0.4, -0.3, 1.2))),
    )
    eye = Motion(np.zeros(3), np.eye(3), (wander(rng, 0.3, (0.5, 2)),), wander(rng, 0.8, (0.5, 2)))
    bank = texture_bank(7, plain=2, dense=10)
    scene = Scene((room, *movers, clutter), eye, np.array([0.6, 0.0, -0.8]), 0.5, bank)
    plan = RecordingPlan(seed=5, seconds=0.1, size=BARREL.size)
    return SimulatedRecording(plan, BARREL, scene, draw_sensor(rng, dark=False, sensor="davis346"))
