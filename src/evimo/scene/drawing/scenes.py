"""Draw a whole scene from a seed: a set of the paper's table, or any of them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.scene.bodies import MOST_PARTS, Body, Scene
from evimo.scene.drawing.carriers import Thing
from evimo.scene.drawing.moving import Pace, camera_motion, is_thrown_away, mover_motion
from evimo.scene.drawing.paint import Paint
from evimo.scene.drawing.pools import Pool
from evimo.scene.drawing.rooms import ELEVATION, Room, furnished, net_in_front
from evimo.scene.drawing.space import Box, around, boxes_of, is_free, stays_inside, stays_on_stage, way_of
from evimo.scene.drawing.things import Family, View, draw_thing
from evimo.scene.meshes.bank import NO_MESHES, MeshBank
from evimo.scene.motion import Motion, looking_at, rotation_from_vector
from evimo.scene.textures.bank import TextureBank

F8 = NDArray[np.float64]

NO_MOVERS, NETTED = 0.18, 0.08
BUSY = 0.45  # share of scenes with a dense, fast background and slow, rather plain things: they fire least
WAYS, SLOWER = 20, 0.93  # tried for a mover that passes through nothing, each so much slower
LOOKED_AHEAD_S = 2.0  # of its way that clutter keeps clear of
DIFFUSE, LAMP = 0.2, (0.01, 0.15)  # share of scenes without shadows; angular radius of the light in the others, rad
TILT = (0.08, 0.08, 0.1)  # rad, of the camera away from looking at its focus upright
ROOM_PERIOD, THING_PERIOD = (0.4, 3.0), (0.1, 0.6)  # m, of textures


PACES = {"low": Pace(0.16, 0.3, 0.26), "medium": Pace(0.4, 0.7, 0.6), "high": Pace(0.8, 1.8, 1.3)}


@dataclass(frozen=True, slots=True)
class SetStyle:
    """One set of the paper's table: rooms, pace, share of plain surfaces, numbers of movers, darkness."""

    rooms: tuple[str, ...]
    pace: str
    plain: float
    movers: tuple[int, ...]
    dark: bool = False


SETS = {
    1: SetStyle(("boxes",), "low", 0.3, (1, 2)),
    2: SetStyle(("floor", "wall"), "low", 0.5, (1, 2, 3)),
    3: SetStyle(("table",), "high", 0.15, (2, 3)),
    4: SetStyle(("tabletop",), "low", 0.15, (1,)),
    5: SetStyle(("tabletop",), "medium", 0.15, (2,)),
    6: SetStyle(("boxes",), "high", 0.3, (1, 2, 3), dark=True),
}


def draw_scene(
    rng: np.random.Generator,
    style: SetStyle,
    bank: TextureBank,
    *,
    seconds: float,
    pool: Pool | None = None,
    meshes: MeshBank | None = None,
) -> Scene:
    """One scene; things stand where they are meant to be at a random time within 0...seconds.

    With a pool, movers and clutter are of its families of shapes, and there are as many movers as the set says, never
    none. In a long scene nothing is thrown out of reach, the camera does not stand still for all of it, and fast motion
    is to and fro rather than far. With meshes, some of the things are these.
    """
    kind, busy = str(rng.choice(style.rooms)), rng.random() < BUSY
    plain = float(np.clip(style.plain + rng.normal() * 0.25, 0, 1)) * (0.3 if busy else 1)
    room = furnished(rng, kind, Paint(bank, plain, (1.2, float(rng.uniform(2.0, 3.4))), ROOM_PERIOD))
    pace = _jittered(rng, PACES[style.pace], busy=busy)
    view = viewpoint(rng, kind, room)
    if rng.random() < NETTED:
        net_in_front(room, view.position, view.axes)
    things = Paint(bank, float(rng.choice([0.05, 0.25, 0.7])), (1.2, float(rng.uniform(2.0, 3.4))), THING_PERIOD)
    if busy:
        things = Paint(bank, 0.65, (0.4, 1.6), THING_PERIOD)
    count = 0 if rng.random() < NO_MOVERS and not pool else int(rng.choice(style.movers))
    bodies = _bodies(rng, view, Family(things, pool, meshes), (count, pace.mover, seconds))
    light = rng.normal(size=3) + (0, 0, 1.5)
    moving = [body.motion for body in bodies if body.motion is not None]
    camera = camera_motion(rng, (view.position, view.axes), pace, seconds, movers=moving)
    way, ambient = light / np.linalg.norm(light), float(rng.uniform(0.3, 0.8))
    lamp = 0.0 if rng.random() < DIFFUSE else math.exp(rng.uniform(*np.log(LAMP)))
    return Scene(bodies, camera, way, ambient, bank, meshes=NO_MESHES if meshes is None else meshes, lamp=lamp)


def _jittered(rng: np.random.Generator, pace: Pace, *, busy: bool) -> Pace:
    faster = (1.3, 1.3, 0.45) if busy else (1.0, 1.0, 1.0)
    speeds = (pace.camera, pace.turning, pace.mover)
    return Pace(*(float(v * k * math.exp(rng.normal() * 0.35)) for v, k in zip(speeds, faster, strict=True)))


def viewpoint(rng: np.random.Generator, kind: str, room: Room) -> View:
    """Where the camera is meant to be in a room of this kind, looking at its focus."""
    distance, up, side = rng.uniform(0.7, 1.8), rng.uniform(*ELEVATION[kind]), rng.uniform(-0.5, 0.5)
    way = np.array([math.sin(side) * math.cos(up), -math.cos(side) * math.cos(up), math.sin(up)])
    inside = room.half[:2] - 0.2
    low, high = np.array([*-inside, 0.25]), np.array([*inside, 2 * room.half[2] - 0.2])
    position = np.clip(room.focus + distance * way, low, high)
    tilt = rotation_from_vector(rng.normal(size=3) * TILT)
    axes = looking_at(position, room.focus) @ tilt
    return View(room, position, axes, float(np.linalg.norm(room.focus - position)))


def _bodies(rng: np.random.Generator, view: View, family: Family, movers: tuple[int, float, float]) -> tuple[Body, ...]:
    """The room, movers (how many, m/s, for how long), and clutter: all but the room of one family."""
    count, mover_speed, seconds = movers
    bodies, taken = [view.room.body()], boxes_of(view.room)
    for _ in range(count):
        thing, speed = draw_thing(rng, family, view, taken), mover_speed * math.exp(rng.normal() * 0.5)
        motion = clear_motion(rng, thing, speed, seconds, room=view.room, taken=taken)
        if not is_thrown_away(motion):
            taken.append(around(way_of(motion, min(seconds, LOOKED_AHEAD_S)), thing.half))
        bodies.append(Body(thing.parts, motion))
    parts = sum(len(body.parts) for body in bodies)
    for _ in range(int(rng.integers(3, 9)) if rng.random() < 0.9 else int(rng.integers(0, 2))):
        thing = draw_thing(rng, family, view, taken)
        if (parts := parts + len(thing.parts)) > MOST_PARTS:
            break
        taken.append(Box(thing.at, thing.half))
        bodies.append(Body(thing.placed(), clutter=True))
    return tuple(bodies)


def clear_motion(
    rng: np.random.Generator, thing: Thing, speed: float, seconds: float, *, room: Room, taken: Sequence[Box]
) -> Motion:
    """A mover's motion of one kind, by other and slower ways until one is clear and leaves no table, or the last.

    What is thrown away may go anywhere. room: whose walls and stage hold it. taken: what stands in its way.
    """
    motion = drawn = mover_motion(rng, thing, speed, seconds)
    for k in range(1, WAYS):
        way = way_of(motion, seconds)
        clear = is_free(Box(way, thing.half), taken) and stays_inside(way, thing.half, room)
        rests = thing.how not in ("floor", "legs") or stays_on_stage(way, room)
        if is_thrown_away(drawn) or (clear and rests):
            break
        other = mover_motion(rng, thing, speed * SLOWER**k, seconds)
        motion = other if _kind_of(other) == _kind_of(drawn) else motion
    return motion


def _kind_of(motion: Motion) -> tuple[bool, bool, type]:
    return is_thrown_away(motion), bool(motion.moves), type(motion.rest)
