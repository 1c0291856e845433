"""What holds things up: a hand, a stick, a string, legs, rarely nothing; the same whether things move or not."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evimo.scene.bodies import CYLINDER, ELLIPSOID, Part, Surface
from evimo.scene.drawing.objects import OVERLAP, reach, rod
from evimo.scene.drawing.paint import Paint
from evimo.scene.motion import axes_along, turned

F8 = NDArray[np.float64]

CARRIERS = {"nothing": 0.1, "floor": 0.22, "hand": 0.2, "string": 0.18, "legs": 0.15, "stick": 0.15}
"""Share of things that float or fly, stand, are held, hang, stand on thin legs, and are on a stick that is held."""
BEYOND = 0.25  # m that an arm goes on out of view
SIDES = {(0.0, 0.75): 0.5, (0.95, 0.2): 0.2, (-0.95, 0.2): 0.2, (0.0, -0.75): 0.1}
"""Where arms come from, on the plane Z = 1 of the camera, beyond what it sees: rather from below."""
BEND = (0.03, 0.16)  # of an elbow, aside from the straight line to the shoulder, of its length
LEGS = (0.04, 0.2)  # m, their length
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
    """In a hand, whose arm comes from `shoulder` (3,) in the world and is bent a little.

    Carriers have an even number of round parts, so that families of shapes stay what they are.
    """
    away = shoulder - thing.at
    reached = float(np.linalg.norm(away))
    elbow = 0.5 * away + frame_along(rng, away / reached)[:, 0] * rng.uniform(*BEND) * reached
    towards = elbow / np.linalg.norm(elbow)
    far = max(thing.parts, key=lambda part: float(part.position @ towards))
    grip = far.position + OVERLAP * reach(far.shape, far.half, far.rotation.T @ towards) * towards
    skin, sleeve = paint.surface(rng, plain=1.0), paint.surface(rng, plain=0.5)
    thick = float(rng.uniform(0.024, 0.032))
    bare = grip + (elbow - grip) * min(rng.uniform(0.3, 0.9), 0.25 / float(np.linalg.norm(elbow - grip)))
    axes = frame_along(rng, (elbow - grip) / np.linalg.norm(elbow - grip))
    arm = [
        rod(grip, bare, thick, skin),
        rod(bare, elbow, 1.4 * thick, sleeve),
        Part(ELLIPSOID, np.full(3, 1.45 * thick), elbow, np.eye(3), sleeve),
        rod(elbow, away, 1.5 * thick, sleeve),
    ]
    wide = float(np.clip(reach(far.shape, far.half, far.rotation.T @ axes[:, 0]), 0.02, 0.05))
    return replace(thing, parts=(*thing.parts, *hand_at(grip, axes, wide, skin), *arm), how="hand")


def hand_at(grip: F8, axes: F8, wide: float, skin: Surface) -> list[Part]:
    """Palm, thumb and four fingers around something `wide` m to either side; the arm goes along the third axis."""
    palm, thumb = ((0.042, 0.02, 0.048), (0, 0, 0.035)), ((0.011, 0.012, 0.04), (wide + 0.006, 0.012, 0.0))
    fingers = [
        ((0.009, 0.0095, 0.044 - 0.002 * k * k), (-wide - 0.004, 0.011 - 0.02 * k, -0.008)) for k in range(-1, 3)
    ]
    pieces = [palm, thumb, *fingers]
    return [Part(ELLIPSOID, np.array(half), grip + axes @ np.array(at), axes, skin) for half, at in pieces]


def on_stick(rng: np.random.Generator, thing: Thing, paint: Paint, holder: F8) -> Thing:
    """On a thin stick that someone holds at `holder` (3,) in the world, as puppets are."""
    towards = (holder - thing.at) / np.linalg.norm(holder - thing.at)
    surface, thin = paint.surface(rng, plain=0.9), float(rng.uniform(0.004, 0.009))
    near = min(thing.parts, key=lambda part: float(np.linalg.norm(part.position)))
    tip = near.position + towards * reach(near.shape, near.half, near.rotation.T @ towards)
    stick = rod(near.position, near.position + holder - thing.at, thin, surface)
    collar = rod(tip - 0.012 * towards, tip + 0.012 * towards, 2.5 * thin, surface)
    return replace(thing, parts=(*thing.parts, stick, collar), how="stick")


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


def on_legs(rng: np.random.Generator, thing: Thing, paint: Paint, long: float) -> Thing:
    """On two or four thin legs `long` below it, m."""
    half, surface = thing.half, paint.surface(rng, plain=0.8)
    thin = rng.uniform(0.003, 0.01)
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
    return replace(thing, parts=(*thing.parts, *legs), how="legs")


def frame_along(rng: np.random.Generator, way: F8) -> F8:
    """Axes as columns whose third is the unit vector `way`, rolled at random."""
    return axes_along(way) @ turned(rng.uniform(0, 2 * math.pi))


def out_of_view(rng: np.random.Generator, at: F8, position: F8, axes: F8) -> F8:
    """A place (3,) beyond a side of the picture, for a shoulder of something at `at` (3,), all in the world, m.

    position: (3,) of the camera. axes: (3, 3), the camera's as columns.
    """
    side = list(SIDES)[rng.choice(len(SIDES), p=list(SIDES.values()))]
    z = float((at - position) @ axes[:, 2]) * rng.uniform(0.9, 1.4)
    shoulder = position + z * axes @ np.array([side[0] + rng.normal() * 0.15, side[1], 1.0])
    way = shoulder - at
    return shoulder + BEYOND * way / np.linalg.norm(way)
