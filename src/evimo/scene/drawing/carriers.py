"""What holds things up: a hand, a string, legs, or nothing; the same for things that move and things that do not."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evimo.scene.bodies import CYLINDER, ELLIPSOID, Part
from evimo.scene.drawing.objects import OVERLAP, reach
from evimo.scene.drawing.paint import Paint
from evimo.scene.motion import cross_matrix, turned

F8 = NDArray[np.float64]

CARRIERS = {"nothing": 0.36, "floor": 0.15, "hand": 0.19, "string": 0.17, "legs": 0.13}
"""Share of things that float or fly, stand, are held, hang, and stand on thin legs."""
BEYOND = 0.25  # m that an arm goes on out of view
SIDES = {(0.0, 0.75): 0.5, (0.95, 0.2): 0.2, (-0.95, 0.2): 0.2, (0.0, -0.75): 0.1}
"""Where arms come from, on the plane Z = 1 of the camera, beyond what it sees: rather from below."""
SHORTEST_STRING = 0.15  # m


@dataclass(frozen=True, slots=True)
class Thing:
    """A compound at its place, with what carries it.

    parts:  about its own middle, axes of the world, m; the first `own` are the thing, others carry it.
    at:     (3,) its middle in the world, m. half: (3,) half sizes of the box around it, m. how: one of CARRIERS.
    string: length from the ceiling to the middle, m, if it hangs.
    """

    parts: tuple[Part, ...]
    at: F8
    half: F8
    how: str = "nothing"
    own: int = 0
    string: float = 0.0

    def placed(self) -> tuple[Part, ...]:
        """Its parts in the world."""
        return tuple(replace(part, position=part.position + self.at) for part in self.parts)


def held(rng: np.random.Generator, thing: Thing, paint: Paint, shoulder: F8) -> Thing:
    """In a hand, whose arm comes from `shoulder` (3,) in the world.

    Carriers have an even number of round parts, so that families of shapes stay what they are.
    """
    arm = float(np.linalg.norm(shoulder - thing.at))
    towards = (shoulder - thing.at) / arm
    far = max(thing.parts, key=lambda part: float(part.position @ towards))
    grip = far.position + OVERLAP * reach(far.shape, far.half, far.rotation.T @ towards) * towards
    axes = frame_along(rng, towards)
    wide = float(np.clip(reach(far.shape, far.half, far.rotation.T @ axes[:, 0]), 0.02, 0.05))
    skin, sleeve = paint.surface(rng, plain=1.0), paint.surface(rng, plain=0.5)
    wrist = min(rng.uniform(0.08, 0.25), 0.5 * arm)
    thick = rng.uniform(0.024, 0.032)
    pieces = [
        (ELLIPSOID, (0.042, 0.02, 0.05), (0, 0, 0.035), skin),  # palm
        (ELLIPSOID, (0.011, 0.013, 0.042), (wide + 0.006, 0.01, 0.0), skin),  # thumb
        (ELLIPSOID, (0.011, 0.03, 0.045), (-wide - 0.006, 0.0, -0.01), skin),  # fingers
        (ELLIPSOID, (0.01, 0.012, 0.045), (-wide - 0.004, 0.036, 0.0), skin),
        (CYLINDER, (thick, thick * 0.8, wrist / 2), (0, 0, 0.06 + wrist / 2), skin),
        (CYLINDER, (1.5 * thick, 1.4 * thick, (arm - wrist) / 2), (0, 0, 0.06 + (arm + wrist) / 2), sleeve),
    ]
    hand = [
        Part(shape, np.array(half), grip + axes @ np.array(place), axes, surface)
        for shape, half, place, surface in pieces
    ]
    return replace(thing, parts=(*thing.parts, *hand), how="hand")


def hanging(rng: np.random.Generator, thing: Thing, paint: Paint, ceiling: float) -> Thing:
    """On a string up to the ceiling, tied to a ring or knot."""
    top, length = float(thing.half[2]), ceiling - float(thing.at[2])
    if length - top < SHORTEST_STRING:
        return thing
    surface, thin = paint.surface(rng, plain=1.0), rng.uniform(0.001, 0.004)
    half = (length - 0.8 * top) / 2
    string = Part(CYLINDER, np.array((thin, thin, half)), np.array((0, 0, length - half)), np.eye(3), surface)
    knot = Part(ELLIPSOID, np.full(3, 3 * thin), np.array((0, 0, top)), np.eye(3), surface)
    return replace(thing, parts=(*thing.parts, string, knot), how="string", string=length)


def on_legs(rng: np.random.Generator, thing: Thing, paint: Paint) -> Thing:
    """On two or four thin legs; it is raised by them."""
    half, surface = thing.half, paint.surface(rng, plain=0.8)
    long, thin = rng.uniform(0.04, 0.2), rng.uniform(0.003, 0.01)
    corners = ((-1, -1), (1, 1)) if rng.random() < 0.3 else ((-1, -1), (1, 1), (1, -1), (-1, 1))
    rise = 0.5 * half[2]  # how far legs reach into it
    legs = [
        Part(
            CYLINDER,
            np.array((thin, thin, (long + rise) / 2)),
            np.array((0.55 * x * half[0], 0.55 * y * half[1], -half[2] - long + (long + rise) / 2)),
            np.eye(3),
            surface,
        )
        for x, y in corners
    ]
    return replace(thing, parts=(*thing.parts, *legs), at=thing.at + (0, 0, long), how="legs")


def frame_along(rng: np.random.Generator, way: F8) -> F8:
    """Axes as columns whose third is the unit vector `way`, rolled at random."""
    aside = cross_matrix(way)[:, np.argmin(np.abs(way))]
    aside = aside / np.linalg.norm(aside)
    return np.stack((aside, np.cross(way, aside), way), axis=1) @ turned(rng.uniform(0, 2 * math.pi))


def out_of_view(rng: np.random.Generator, at: F8, position: F8, axes: F8) -> F8:
    """A place (3,) beyond a side of the picture, for a shoulder of something at `at` (3,), all in the world, m.

    position: (3,) of the camera. axes: (3, 3), the camera's as columns.
    """
    side = list(SIDES)[rng.choice(len(SIDES), p=list(SIDES.values()))]
    z = float((at - position) @ axes[:, 2]) * rng.uniform(0.9, 1.4)
    shoulder = position + z * axes @ np.array([side[0] + rng.normal() * 0.15, side[1], 1.0])
    way = shoulder - at
    return shoulder + BEYOND * way / np.linalg.norm(way)
