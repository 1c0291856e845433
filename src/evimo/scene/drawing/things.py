"""Things in view, moving or not: one family of shapes, surfaces, places and carriers for both."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evimo.scene.bodies import Part
from evimo.scene.drawing.carriers import CARRIERS, Thing, hanging, held, on_legs, on_stick, out_of_view
from evimo.scene.drawing.objects import compound, size_of
from evimo.scene.drawing.paint import Paint
from evimo.scene.drawing.pools import Pool
from evimo.scene.drawing.rooms import Room
from evimo.scene.drawing.space import Box, is_free
from evimo.scene.meshes.bank import MeshBank
from evimo.scene.motion import random_rotation, turned

F8 = NDArray[np.float64]
NEAREST = 2.4  # times a thing's largest half size: it fills half of the picture's width there at most
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
    """One thing with what carries it, in view, nearer than the focus, and in nothing that is `taken`, if it can be."""
    how = str(rng.choice(list(CARRIERS), p=list(CARRIERS.values())))
    stands = how in ("floor", "legs")
    parts = compound(rng, family.paint, family.pool, family.meshes)
    parts = turned_parts(parts, turned(rng.uniform(0, 6.3)) if stands else random_rotation(rng))
    half = size_of(parts, family.meshes)
    at = _free_place(rng, half, view, taken, stands=stands)
    thing = Thing(parts, at, half, "floor" if stands else "nothing", own=len(parts))
    if how in ("hand", "stick"):
        carry = held if how == "hand" else on_stick
        return carry(rng, thing, family.paint, out_of_view(rng, at, view.position, view.axes))
    if how == "string":
        return hanging(rng, thing, family.paint, 2 * view.room.half[2])
    return on_legs(rng, thing, family.paint) if how == "legs" else thing


def turned_parts(parts: tuple[Part, ...], turn: F8) -> tuple[Part, ...]:
    """A compound turned about the origin."""
    return tuple(replace(part, position=turn @ part.position, rotation=turn @ part.rotation) for part in parts)


def _free_place(rng: np.random.Generator, half: F8, view: View, taken: Sequence[Box], *, stands: bool) -> F8:
    """A place where there is room, or the last one tried."""
    for _ in range(TRIES):
        at = _place(rng, half, view, stands=stands)
        if is_free(Box(at, half), taken):
            return at
    return _place(rng, half, view, stands=stands)


def _place(rng: np.random.Generator, half: F8, view: View, *, stands: bool) -> F8:
    bottom = float(half[2])
    z = max(rng.uniform(0.35, 1.0) * min(view.distance, 1.2), NEAREST * float(half.max()))
    at = view.position + view.axes @ (z * np.array([rng.uniform(-0.55, 0.55), rng.uniform(-0.4, 0.4), 1.0]))
    if stands:
        return np.array([*np.clip(at[:2], *view.room.stage), view.room.support + bottom])
    return np.array([at[0], at[1], max(at[2], bottom)])
