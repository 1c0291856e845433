"""A small scene that every test of this room can compute by hand."""

import numpy as np
import pytest

from evimo.geometry.camera import Camera
from evimo.scene.bodies import BOX, CYLINDER, ELLIPSOID, GRATING, Body, Part, Scene, Surface
from evimo.scene.motion import Motion, random_rotation, wander
from evimo.scene.textures.bank import TextureBank, texture_bank

BARREL = Camera(fx=25.0, fy=26.0, cx=18.5, cy=13.5, height=28, width=38, distortion=(-0.3, 0.08, 1e-3, -5e-4))


@pytest.fixture(scope="session")
def bank() -> TextureBank:
    return texture_bank(7, plain=2, dense=10)


@pytest.fixture(scope="session")
def camera() -> Camera:
    return BARREL


@pytest.fixture(scope="session")
def small_scene(bank: TextureBank) -> Scene:
    """A room, a net, one clutter body and two movers, seen by a camera that moves and turns."""
    rng = np.random.default_rng(3)

    def part(shape: int, half: tuple, position: tuple, *, turned: bool = True, **how: object) -> Part:
        surface = Surface(int(rng.integers(2, 12)), 0.4, (0.1, 0.2), 0.1, 0.9)
        rotation = random_rotation(rng) if turned else np.eye(3)
        return Part(shape, np.array(half), np.array(position), rotation, surface, **how)  # type: ignore[arg-type]

    def motion(position: tuple) -> Motion:
        moves, turns = wander(rng, 0.5, (0.5, 2.0)), wander(rng, 2.0, (0.5, 2.0))
        return Motion(np.array(position, float), random_rotation(rng), (moves,), turns)

    room = Body(
        (
            part(BOX, (2.0, 1.5, 3.0), (0, 0, 0), turned=False, inside=True),
            part(GRATING, (0.5, 0.4, 0.01), (-0.5, 0.2, 1.2), openings=(4.0, 3.0, 0.4, 0.3)),
        )
    )
    clutter = Body((part(CYLINDER, (0.15, 0.15, 0.3), (0.6, 0.3, 1.5)),), clutter=True)
    movers = (
        Body(
            (part(BOX, (0.2, 0.1, 0.15), (0, 0, 0)), part(ELLIPSOID, (0.1, 0.2, 0.1), (0.2, 0, 0))), motion((0, 0, 1.3))
        ),
        Body((part(CYLINDER, (0.1, 0.14, 0.2), (0, 0.05, 0)),), motion((0.4, -0.3, 1.0))),
    )
    eye = Motion(np.zeros(3), np.eye(3), (wander(rng, 0.3, (0.5, 2)),), wander(rng, 0.8, (0.5, 2)))
    return Scene((room, *movers, clutter), eye, np.array([0.6, 0.0, -0.8]), 0.5, bank)


@pytest.fixture(scope="session")
def within():
    """Tells which points (N, 3) are well inside a part."""

    def inside(part, points):
        along = np.abs((points - part.position) @ part.rotation) / part.half
        if part.shape == ELLIPSOID:
            return (along**2).sum(axis=1) < 0.9
        if part.shape == CYLINDER:
            return (along[:, 0] ** 2 + along[:, 1] ** 2 < 0.9) & (along[:, 2] < 0.95)
        return (along < 0.95).all(axis=1)

    return inside
