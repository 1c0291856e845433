"""Draw scenes as EV-IMO's pictures show them: toys played with on floors and tables, before a camera held by hand."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from evimo.scene.bodies import MOST_PARTS, Body, Scene, Surface
from evimo.scene.drawing.moving import Pace, camera_motion, is_thrown_away
from evimo.scene.drawing.paint import Paint
from evimo.scene.drawing.playing import LONG_S, Play, placed_toy, played
from evimo.scene.drawing.rooms import ELEVATION, Room, furnished
from evimo.scene.drawing.scenes import DIFFUSE, LAMP, PACES, ROOM_PERIOD, TILT, SetStyle
from evimo.scene.drawing.space import Box, around, boxes_of, is_free, stays_inside, way_of
from evimo.scene.drawing.things import View
from evimo.scene.drawing.toys import drawn_kind
from evimo.scene.meshes.bank import NO_MESHES, MeshBank
from evimo.scene.motion import looking_at, rotation_from_vector
from evimo.scene.textures.bank import TextureBank

F8 = NDArray[np.float64]

NO_MOVERS = 0.08  # share of short training scenes without any
FOLLOWED = 0.1  # share of cameras that follow a mover
MAPS = 4  # textures of streets in a bank, for tables
DISTANCE = {"boxes": (1.0, 2.0), "floor": (0.9, 1.5), "wall": (1.0, 1.9), "table": (0.75, 1.3), "tabletop": (0.7, 1.1)}
PIXELS = {"low": (2.7, 9.0), "medium": (3.0, 9.0), "high": (4.0, 11.0)}  # of movers, per slice of 25 ms
ROOM_FAINT = 0.15  # of patterned surfaces of rooms
LOW_FOCUS, LOW_ELEVATION = 0.2, (0.25, 0.65)  # m and rad, in rooms of boxes: their floor is in view
FLOOR_PLAIN = 0.5  # times the set's share of plain surfaces, before floors
CLUTTERED = ("boxes", "tabletop")  # rooms where toys stand about
MOST_STANDING = 4
TOY_CONTRAST, TOY_PERIOD = (1.3, 3.0), (0.08, 0.3)


def draw_replica_scene(
    rng: np.random.Generator,
    style: SetStyle,
    bank: TextureBank,
    *,
    seconds: float,
    part: str | None = None,
    empty: float = 0.0,
    meshes: MeshBank | None = None,
) -> Scene:
    """One scene of a set of the paper's table; its movers say of which kind of toy they are.

    part: `train` or `test`, which alone has the kinds of `toys.UNSEEN`. empty: chance of no movers.
    bank: with maps, for the tables. meshes: the user's own, which some of the toys are then.
    """
    kind = str(rng.choice(style.rooms))
    bare = style.plain * (FLOOR_PLAIN if kind == "floor" else 1.0)
    plain, brightest = float(np.clip(bare + rng.normal() * 0.15, 0, 0.8)), float(rng.uniform(2.0, 3.0))
    room = furnished(rng, kind, Paint(bank, plain, (1.2, brightest), ROOM_PERIOD, ROOM_FAINT), cloth=_cloth(rng, bank))
    view, pace = _viewpoint(rng, kind, room), _jittered(rng, PACES[style.pace])
    camera = camera_motion(rng, (view.position, view.axes), pace, seconds, followed=0.0)
    toys = Paint(bank, 0.1, TOY_CONTRAST, TOY_PERIOD, faint=0.0)
    play = Play(view, kind, toys, camera, PIXELS[style.pace], seconds, meshes)
    count = 0 if rng.random() < empty else int(rng.choice(style.movers))
    bodies = _bodies(rng, play, part, count)
    leaders = [body.motion for body in bodies if body.motion is not None and not is_thrown_away(body.motion)]
    if leaders and rng.random() < FOLLOWED:
        camera = camera_motion(rng, (view.position, view.axes), pace, seconds, movers=leaders, followed=1.0)
    light = rng.normal(size=3) + (0, 0, 1.5)
    lamp = 0.0 if rng.random() < DIFFUSE else math.exp(rng.uniform(*np.log(LAMP)))
    way, ambient = light / np.linalg.norm(light), float(rng.uniform(0.3, 0.8))
    kept = NO_MESHES if meshes is None else meshes
    return Scene(bodies, camera, way, ambient, bank, meshes=kept, lamp=lamp, room=kind)


def _cloth(rng: np.random.Generator, bank: TextureBank) -> Surface:
    """A map of streets, 0.6 to 1.2 m until it repeats."""
    kinds = bank.maps if len(bank.maps) else bank.dense
    shift = (float(rng.random()), float(rng.random()))
    dark = float(rng.uniform(0.06, 0.12))
    return Surface(int(rng.choice(kinds)), float(rng.uniform(0.6, 1.2)), shift, dark, dark * float(rng.uniform(5, 8)))


def _jittered(rng: np.random.Generator, pace: Pace) -> Pace:
    return Pace(*(speed * math.exp(rng.normal() * 0.3) for speed in (pace.camera, pace.turning, pace.mover)))


def _viewpoint(rng: np.random.Generator, kind: str, room: Room) -> View:
    """Where the camera is meant to be, looking at the room's focus from as near as toys are filmed."""
    room.focus[2] = LOW_FOCUS if kind == "boxes" else room.focus[2]
    elevation = LOW_ELEVATION if kind == "boxes" else ELEVATION[kind]
    distance, up, side = rng.uniform(*DISTANCE[kind]), rng.uniform(*elevation), rng.uniform(-0.6, 0.6)
    way = np.array([math.sin(side) * math.cos(up), -math.cos(side) * math.cos(up), math.sin(up)])
    inside = room.half[:2] - 0.25
    low, high = np.array([*-inside, 0.3]), np.array([*inside, 2 * room.half[2] - 0.3])
    position = np.clip(room.focus + distance * way, low, high)
    axes = looking_at(position, room.focus) @ rotation_from_vector(rng.normal(size=3) * TILT)
    return View(room, position, axes, float(np.linalg.norm(room.focus - position)))


def _bodies(rng: np.random.Generator, play: Play, part: str | None, count: int) -> tuple[Body, ...]:
    """The room, movers, and toys that stand about."""
    bodies, taken = [play.view.room.body()], boxes_of(play.view.room)
    for _ in range(count):
        mover = played(rng, play, drawn_kind(part, play.meshes, rng), taken)
        taken.append(around(way_of(mover.motion, min(play.seconds, LONG_S)), mover.thing.half))
        bodies.append(mover.body())
    standing = int(rng.integers(0, MOST_STANDING + 1)) if play.kind in CLUTTERED else 0
    for _ in range(standing):
        kind = drawn_kind(part, play.meshes, rng)
        thing = placed_toy(rng, play, kind, "rolling")
        fits = is_free(Box(thing.at, thing.half), taken) and stays_inside(thing.at[None], thing.half, play.view.room)
        if not fits or sum(len(body.parts) for body in bodies) + len(thing.parts) > MOST_PARTS:
            continue
        stage = play.view.room.stage
        if (thing.at[:2] > stage[0]).all() and (thing.at[:2] < stage[1]).all():
            taken.append(Box(thing.at, thing.half))
            bodies.append(replace(Body(thing.placed(), clutter=True), kind=kind))
    return tuple(bodies)
