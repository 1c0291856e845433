"""Things in view, moving or not: one family of shapes, surfaces, places and carriers for both."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evimo.scene.bodies import Part
from evimo.scene.drawing.carriers import CARRIERS, LEGS, Thing, hanging, held, on_legs, on_stick, out_of_view
from evimo.scene.drawing.objects import compound, size_of
from evimo.scene.drawing.paint import Paint
from evimo.scene.drawing.pools import Pool
from evimo.scene.drawing.rooms import Room
from evimo.scene.drawing.space import Box, is_free, stays_inside
from evimo.scene.meshes.bank import MeshBank
from evimo.scene.motion import random_rotation, turned

F8 = NDArray[np.float64]
NEAREST, FARTHEST = 3.0, 2.2  # times a thing's largest half size: half of the picture's width; m, of what stands
TRIES = 12  # looks for a place where nothing else is


@dataclass(frozen=True, slots=True)
class View:
    """What the camera sees at its mean pose.

    position: (3,) m. axes: (3, 3), the camera's as columns. distance: of what it looks at, m.
    """

    room: Room
    position: F8
    axes: F8
    distance: float


@dataclass(frozen=True, slots=True)
class Family:
    """What things of one scene are drawn from."""

    paint: Paint
    pool: Pool | None = None
    meshes: MeshBank | None = None


def draw_thing(rng: np.random.Generator, family: Family, view: View, taken: Sequence[Box] = ()) -> Thing:
    """One thing with what carries it, where there is room; in view and nearer than the focus, unless it stands."""
    how = str(rng.choice(list(CARRIERS), p=list(CARRIERS.values())))
    stands = how in ("floor", "legs")
    parts = compound(rng, family.paint, family.pool, family.meshes)
    parts = turned_parts(parts, turned(rng.uniform(0, 6.3)) if stands else random_rotation(rng))
    half, legs = size_of(parts, family.meshes), float(rng.uniform(*LEGS)) if how == "legs" else 0.0
    at = _free_place(rng, half, view, taken, above=legs if stands else None)
    thing = Thing(parts, at, half, "floor" if stands else "nothing", own=len(parts))
    if how in ("hand", "stick"):
        carry = held if how == "hand" else on_stick
        return carry(rng, thing, family.paint, out_of_view(rng, at, view.position, view.axes))
    if how == "string":
        return hanging(rng, thing, family.paint, 2 * view.room.half[2])
    return on_legs(rng, thing, family.paint, legs) if how == "legs" else thing


def turned_parts(parts: tuple[Part, ...], turn: F8) -> tuple[Part, ...]:
    """A compound turned about the origin."""
    return tuple(replace(part, position=turn @ part.position, rotation=turn @ part.rotation) for part in parts)


def _free_place(rng: np.random.Generator, half: F8, view: View, taken: Sequence[Box], *, above: float | None) -> F8:
    """A place where there is room, if one of some is such; `above` what things stand on, m, if it does."""
    at = _place(rng, half, view, above)
    for _ in range(TRIES):
        if is_free(Box(at, half), taken) and stays_inside(at[None], half, view.room):
            break
        at = _place(rng, half, view, above)
    return at


def _place(rng: np.random.Generator, half: F8, view: View, above: float | None) -> F8:
    bottom = float(half[2])
    ray = view.axes @ (rng.uniform(-0.55, 0.55), rng.uniform(-0.4, 0.4), 1.0)
    z = max(rng.uniform(0.35, 1.0) * min(view.distance, 1.2), NEAREST * float(half.max()))
    if above is None:
        at = view.position + z * ray
        return np.array([at[0], at[1], max(at[2], bottom)])
    height = view.room.support + above + bottom
    if ray[2] < 0:  # where the ray comes down to that height
        z = float(np.clip((height - view.position[2]) / ray[2], z, FARTHEST))
    at = view.position + z * ray
    return np.array([*np.clip(at[:2], *view.room.stage), height])
