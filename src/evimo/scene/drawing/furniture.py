"""A room while it is being furnished, and thin and flat things in it: tape, cables, chairs, ladders, posters."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from evimo.scene.bodies import BOX, Body, Part, Surface
from evimo.scene.drawing.objects import rod
from evimo.scene.drawing.paint import Paint
from evimo.scene.motion import turned

F8 = NDArray[np.float64]


@dataclass(slots=True)
class Room:
    """A room while it is being furnished.

    half:    (3,) half sizes, m; the floor's middle is the origin, z is up, the far wall is at +y.
    focus:   (3,) what the camera looks at. support: height of what things stand on there, m.
    stage:   (2, 2) lowest and highest x and y of that. cloth: what covers a table, if not the room's own paint.
    """

    rng: np.random.Generator
    paint: Paint
    half: F8
    focus: F8 = field(default_factory=lambda: np.zeros(3))
    support: float = 0.0
    stage: F8 = field(default_factory=lambda: np.array([[-9.0, -9.0], [9.0, 9.0]]))
    parts: list[Part] = field(default_factory=list)
    cloth: Surface | None = None

    def add(self, shape: int, position: tuple[float, ...] | F8, half: tuple[float, ...] | F8, **how: object) -> None:
        """A part at `position` with half sizes `half`; `how`: rotation, plain (share) or surface, fields of Part."""
        plain, rotation, surface = how.pop("plain", None), how.pop("rotation", np.eye(3)), how.pop("surface", None)
        surface = surface or self.paint.surface(self.rng, plain=plain)  # type: ignore[arg-type]
        where, size = np.asarray(position, np.float64), np.asarray(half, np.float64)
        self.parts.append(Part(shape, size, where, rotation, surface, **how))  # type: ignore[arg-type]

    def within(self, share: float, axis: int) -> float:
        """A coordinate within this share of the room."""
        return float(self.rng.uniform(-share, share) * self.half[axis])

    def body(self) -> Body:
        """The furnished room."""
        return Body(tuple(self.parts))


def lay_floor_details(room: Room) -> None:
    """A rug, lines of tape and cables."""
    rng = room.rng
    if rng.random() < 0.5:
        at = (room.within(0.3, 0), room.within(0.5, 1), 0.006)
        room.add(BOX, at, (rng.uniform(0.3, 1.0), rng.uniform(0.3, 0.8), 0.003), rotation=turned(rng.uniform(0, 6.3)))
    for _ in range(int(rng.integers(0, 4))):
        at, along = (room.within(0.6, 0), room.within(0.8, 1), 0.01), turned(rng.uniform(0, 6.3))
        room.add(BOX, at, (rng.uniform(0.3, 1.0), rng.uniform(0.01, 0.03), 0.002), rotation=along, plain=1.0)
    for _ in range(int(rng.choice([0, 0, 1, 2]))):
        _cable(room)


def _cable(room: Room) -> None:
    """A chain of rods that winds over the floor."""
    rng = room.rng
    thick, way = float(rng.uniform(0.003, 0.008)), rng.uniform(0, 2 * math.pi)
    surface = room.paint.surface(rng, plain=1.0)
    point = np.array([room.within(0.6, 0), room.within(0.8, 1), 0.004 + thick])
    for _ in range(int(rng.integers(3, 7))):
        way += rng.normal() * 0.5
        following = point + rng.uniform(0.12, 0.35) * np.array([math.cos(way), math.sin(way), 0.0])
        room.parts.append(rod(point, following, thick, surface))
        point = following


def add_chair(room: Room, at: F8) -> None:
    """A seat, a back and four thin legs; `at` (2,) on the floor."""
    rng = room.rng
    turn, seat = turned(rng.uniform(0, 2 * math.pi)), float(rng.uniform(0.4, 0.5))
    half, thick = rng.uniform(0.17, 0.23), float(rng.uniform(0.01, 0.018))
    middle, (cloth, metal) = np.array([*at, 0.0]), (room.paint.surface(rng, plain=p) for p in (0.6, 1.0))
    room.add(BOX, middle + (0, 0, seat), (half, half, 0.02), rotation=turn, surface=cloth)
    room.add(BOX, middle + turn @ np.array([0, half, seat + 0.28]), (half, 0.012, 0.17), rotation=turn, surface=cloth)
    for x, y in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        foot = middle + turn @ np.array([0.9 * x * half, 0.9 * y * half, 0.0])
        room.parts.append(rod(foot, foot + (0, 0, seat + (0.45 if y > 0 else 0.0)), thick, metal))


def lean_ladder(room: Room) -> None:
    """Two rails and rungs, against the far wall."""
    rng = room.rng
    wide, high, lean = float(rng.uniform(0.16, 0.24)), float(rng.uniform(1.3, 2.1)), float(rng.uniform(0.2, 0.5))
    x, y, thick = room.within(0.7, 0), room.half[1] - 0.05, float(rng.uniform(0.01, 0.02))
    surface = room.paint.surface(rng, plain=1.0)

    def rail(side: int, share: float) -> F8:
        return np.array([x + side * wide, y - lean * (1 - share), high * share])

    for side in (-1, 1):
        room.parts.append(rod(rail(side, 0.0), rail(side, 1.0), thick, surface))
    for share in np.arange(0.14, 1.0, 0.28 / high):
        room.parts.append(rod(rail(-1, share), rail(1, share), 0.7 * thick, surface))


def hang_on_walls(room: Room, most: int) -> None:
    """Posters, windows, boards and doors on the far wall and the ones beside it: strong edges on plain ground."""
    rng = room.rng
    for _ in range(int(rng.integers(0, most + 1))):
        wide, tall = rng.uniform(0.1, 0.5), rng.uniform(0.1, 0.4)
        height = rng.uniform(0.5, 2.0)
        if rng.random() < 0.15:
            wide, tall, height = 0.42, 1.0, 1.0  # a door
        side = rng.choice([0, 0, 0, -1, 1])
        along = room.within(0.7, 0 if side == 0 else 1)
        at = (along, room.half[1], height) if side == 0 else (side * room.half[0], along, height)
        room.add(BOX, at, (wide, 0.015, tall) if side == 0 else (0.015, wide, tall), plain=0.3)
