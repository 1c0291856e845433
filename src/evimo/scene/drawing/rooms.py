"""The five kinds of rooms of EV-IMO's sets: boxes, floor, wall, table, tabletop."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from evimo.scene.bodies import BOX, CYLINDER, ELLIPSOID, GRATING, Surface
from evimo.scene.drawing.furniture import Room, add_chair, hang_on_walls, lay_floor_details, lean_ladder
from evimo.scene.drawing.paint import Paint
from evimo.scene.motion import turned

F8 = NDArray[np.float64]
Range = tuple[float, float]
ELEVATION: dict[str, Range] = {  # of the camera above what it looks at, rad
    "boxes": (0.1, 0.6),
    "floor": (0.8, 1.35),
    "wall": (-0.2, 0.2),
    "table": (0.3, 0.8),
    "tabletop": (0.3, 0.9),
}
CHAIRS = {"boxes": 0.25, "floor": 0.15, "wall": 0.2, "table": 0.5, "tabletop": 0.3}  # share of rooms with one or two
LADDER = 0.1
WALL_PERIOD = (1.0, 4.0)  # m, of textures: a photograph is not on a wall many times
PLAIN_WALLS, BUSY_BELOW = (
    0.75,
    0.15,
)  # share of plain walls, where the room is not busy: where so few surfaces are plain


def furnished(rng: np.random.Generator, kind: str, paint: Paint, *, cloth: Surface | None = None) -> Room:
    """A room of one kind; `cloth` covers its table, if it has one."""
    half = np.array([rng.uniform(2.5, 5), rng.uniform(2.5, 5), rng.uniform(2.3, 3.2)]) / 2
    room = Room(rng, paint, half, cloth=cloth)
    calm = PLAIN_WALLS if paint.plain > BUSY_BELOW or (kind == "wall" and rng.random() < 0.6) else None
    walls = replace(paint, period=WALL_PERIOD).surface(rng, plain=calm)
    room.add(BOX, (0, 0, half[2]), half, inside=True, surface=walls)
    room.add(BOX, (0, 0, -0.01), (half[0], half[1], 0.012))
    _KINDS[kind](room)
    if rng.random() < 0.6:
        lay_floor_details(room)
    if rng.random() < CHAIRS[kind]:
        for _ in range(int(rng.integers(1, 3))):
            add_chair(room, np.array([room.within(0.7, 0), rng.uniform(-0.1, 0.8) * half[1]]))
    if rng.random() < LADDER:
        lean_ladder(room)
    return room


def _boxes(room: Room) -> None:
    rng = room.rng
    for _ in range(int(rng.integers(4, 12))):
        half = rng.uniform(0.06, 0.35, 3)
        height = half[2] * rng.choice([1, 1, 3])
        room.add(
            BOX,
            (room.within(0.9, 0), rng.uniform(0.1, 0.95) * room.half[1], height),
            half,
            rotation=turned(rng.uniform(0, 6.3)),
        )
    hang_on_walls(room, 3)
    room.focus = np.array([room.within(0.3, 0), room.half[1] * 0.7, 0.5])


def _table(room: Room, items: tuple[int, int] = (0, 5)) -> None:
    rng = room.rng
    room.support = float(rng.uniform(0.6, 0.9))
    top = np.array([rng.uniform(0.4, 0.9), rng.uniform(0.3, 0.6), 0.02])
    middle = np.array([room.within(0.2, 0), room.half[1] * rng.uniform(0.2, 0.6), room.support - top[2]])
    room.add(BOX, middle, top, surface=room.cloth)
    room.stage = np.stack((middle[:2] - 0.9 * top[:2], middle[:2] + 0.9 * top[:2]))
    wood = room.paint.surface(rng, plain=0.8)
    thick = float(rng.uniform(0.012, 0.035))
    for x in (-0.9, 0.9):
        for y in (-0.9, 0.9):
            leg = (middle[0] + x * top[0], middle[1] + y * top[1], room.support / 2 - 0.01)
            room.add(CYLINDER, leg, (thick, thick, room.support / 2 - 0.01), surface=wood)
    for _ in range(int(rng.integers(*items))):
        half = rng.uniform(0.02, 0.13, 3)
        at = (*(middle[:2] + rng.uniform(-0.85, 0.85, 2) * top[:2]), room.support + half[2])
        room.add(int(rng.choice([BOX, ELLIPSOID, CYLINDER])), at, half, rotation=turned(rng.uniform(0, 6.3)))
    hang_on_walls(room, 3)
    room.focus = middle + (0, 0, 0.1)


def _tabletop(room: Room) -> None:
    _table(room, (3, 12))


def _wall(room: Room) -> None:
    rng = room.rng
    hang_on_walls(room, 4)
    if rng.random() < 0.2:  # a rack or a grid against it
        pitch = (float(rng.uniform(0.5, 2)), float(rng.uniform(2, 8)), 0.1, 0.15)
        _net(room, (room.within(0.5, 0), room.half[1] - 0.1, 1.0), np.array([0.3, 1.0, 0.01]), pitch)
    room.focus = np.array([room.within(0.3, 0), room.half[1], rng.uniform(0.8, 1.6)])


def _floor(room: Room) -> None:
    rng = room.rng
    for _ in range(int(rng.integers(0, 4))):
        half = rng.uniform(0.03, 0.2, 3)
        at = (rng.uniform(-0.8, 0.8), rng.uniform(-0.2, 1.2), half[2])
        room.add(int(rng.choice([BOX, CYLINDER])), at, half, rotation=turned(rng.uniform(0, 6.3)))
    room.focus = np.array([0, 0.4, 0.0])


def net_in_front(room: Room, camera: F8, axes: F8) -> None:
    """A net or a fence of bars between the camera and the scene; `axes` are the camera's as columns."""
    rng = room.rng
    distance, half = rng.uniform(0.3, 0.6), np.array([rng.uniform(0.25, 0.8), rng.uniform(0.25, 0.8), 0.01])
    pitch, bar = rng.uniform(0.025, 0.12), rng.uniform(0.003, 0.012)
    bars = (0.0 if rng.random() < 0.15 else bar / pitch, 0.0 if rng.random() < 0.15 else bar / pitch)
    tilted = axes @ turned(rng.normal() * 0.3)
    at = camera + distance * axes[:, 2] + axes[:, :2] @ rng.normal(0, 0.08, 2)
    _net(room, at, half, (half[0] / pitch, half[1] / pitch, *bars), rotation=tilted)


def _net(
    room: Room, at: tuple[float, ...] | F8, half: F8, openings: tuple[float, ...], *, rotation: F8 | None = None
) -> None:
    upright = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]) if rotation is None else rotation
    room.add(GRATING, at, half, rotation=upright, openings=openings, plain=0.6)


_KINDS = {"boxes": _boxes, "floor": _floor, "wall": _wall, "table": _table, "tabletop": _tabletop}
