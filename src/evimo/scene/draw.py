"""Draw a whole scene from a seed: a set of the paper's table, or any of them."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.scene.bodies import Body, Part, Scene
from evimo.scene.motion import Curve, Motion, Rest, Throw, looking_at, random_rotation, rotation_from_vector, wander
from evimo.scene.objects import compound, size_of
from evimo.scene.paint import Paint
from evimo.scene.pools import Pool
from evimo.scene.rooms import ELEVATION, Room, furnished, net_in_front
from evimo.scene.textures import TextureBank

F8 = NDArray[np.float64]

NO_MOVERS, STATIC_CAMERA, PAUSED_CAMERA, RESTING_MOVER, NETTED = 0.15, 0.06, 0.08, 0.2, 0.08
FOREVER = 1e4
LONG_S = 2.0  # from here on a scene of a pool is held together, or what moves in it would be gone for most of the time
REACH, TURN = 0.2, 0.15  # m and rad: root mean square of excursions in such a scene
TILT = (0.08, 0.08, 0.1)  # rad, of the camera away from looking at its focus upright


@dataclass(frozen=True, slots=True)
class Pace:
    """Root mean square speeds: camera m/s, camera rad/s, movers m/s."""

    camera: float
    turning: float
    mover: float


PACES = {"low": Pace(0.15, 0.25, 0.3), "medium": Pace(0.4, 0.7, 0.7), "high": Pace(0.8, 1.8, 1.5)}


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
    rng: np.random.Generator, style: SetStyle, bank: TextureBank, *, seconds: float, pool: Pool | None = None
) -> Scene:
    """One scene; things stand where they are meant to be at a random time within 0...seconds.

    With a pool, movers and clutter are of its families of shapes, there are as many movers as the set says, never
    none; and in a long scene nothing is thrown, the camera does not stand still for all of it, and fast motion is to
    and fro rather than far.
    """
    kind = str(rng.choice(style.rooms))
    plain = float(np.clip(style.plain + rng.normal() * 0.25, 0, 1))
    paint = Paint(bank, plain, (0.5, float(rng.uniform(1.2, 3.2))), (0.15, 1.2))
    room = furnished(rng, kind, paint)
    pace = _jittered(rng, PACES[style.pace])
    position, axes, distance = _viewpoint(rng, kind, room)
    if rng.random() < NETTED:
        net_in_front(room, position, axes)
    bodies = _bodies(rng, bank, (room, position, axes, distance), (style, pace, seconds), pool=pool)
    light = rng.normal(size=3) + (0, 0, 1.5)
    camera = _camera_motion(rng, (position, axes), pace, seconds, long=pool is not None and seconds >= LONG_S)
    return Scene(bodies, camera, light / np.linalg.norm(light), float(rng.uniform(0.3, 0.8)), bank)


def _jittered(rng: np.random.Generator, pace: Pace) -> Pace:
    return Pace(*(float(v * math.exp(rng.normal() * 0.35)) for v in (pace.camera, pace.turning, pace.mover)))


def _viewpoint(rng: np.random.Generator, kind: str, room: Room) -> tuple[F8, F8, float]:
    """Where the camera is and how it looks (axes as columns), and how far away its focus is."""
    distance, up, side = rng.uniform(0.7, 1.8), rng.uniform(*ELEVATION[kind]), rng.uniform(-0.5, 0.5)
    way = np.array([math.sin(side) * math.cos(up), -math.cos(side) * math.cos(up), math.sin(up)])
    inside = room.half[:2] - 0.2
    low, high = np.array([*-inside, 0.25]), np.array([*inside, 2 * room.half[2] - 0.2])
    position = np.clip(room.focus + distance * way, low, high)
    tilt = rotation_from_vector(rng.normal(size=3) * TILT)
    axes = looking_at(position, room.focus) @ tilt
    return position, axes, float(np.linalg.norm(room.focus - position))


def _camera_motion(rng: np.random.Generator, pose: tuple[F8, F8], pace: Pace, seconds: float, *, long: bool) -> Motion:
    """Hand-held: it sways and turns, sometimes trembles, pauses, or stands still."""
    zero_s = float(rng.uniform(0, seconds))
    moves: list[Curve] = [wander(rng, pace.camera, _band((0.2, 2.5), pace.camera, REACH, long=long), zero_s=zero_s)]
    if rng.random() < 0.3:
        moves.append(wander(rng, rng.uniform(0.02, 0.1), (5, 10), zero_s=zero_s))
    turns = wander(rng, pace.turning, _band((0.3, 3.0), pace.turning, TURN, long=long), zero_s=zero_s)
    rest = None
    if (chance := rng.random()) < STATIC_CAMERA and not long:
        rest = Rest(-FOREVER, FOREVER, 0.1)
    elif chance < STATIC_CAMERA + PAUSED_CAMERA:
        rest = _rest(rng, seconds)
    return Motion(*pose, tuple(moves), turns, rest)


def _band(band: tuple[float, float], rate: float, reach: float, *, long: bool) -> tuple[float, float]:
    """Hz; in a long scene without the low frequencies at which this rate (rms, per second) goes beyond `reach`."""
    low, high = band
    return (min(max(low, rate / (2 * math.pi * reach)), 0.8 * high), high) if long else band


def _rest(rng: np.random.Generator, seconds: float) -> Rest:
    start = float(rng.uniform(-0.5, 0.8) * seconds)
    return Rest(start, start + float(rng.uniform(0.1, 1.0)), float(rng.uniform(0.005, 0.1)))


def _bodies(
    rng: np.random.Generator,
    bank: TextureBank,
    view: tuple[Room, F8, F8, float],
    dynamics: tuple[SetStyle, Pace, float],
    *,
    pool: Pool | None,
) -> tuple[Body, ...]:
    """The room, movers, and clutter of the same family of shapes, textures and places as the movers."""
    style, pace, seconds = dynamics
    family = Paint(bank, float(rng.choice([0.05, 0.25, 0.7])), (0.5, float(rng.uniform(1.2, 3.2))), (0.06, 0.35))
    count = 0 if rng.random() < NO_MOVERS and not pool else int(rng.choice(style.movers))
    shy = rng.random() < 0.2  # slow plain movers: the background then fires most events
    own = Paint(bank, 0.85, (0.2, 0.8), (0.1, 0.5)) if shy else family
    slow = Pace(pace.camera, pace.turning, pace.mover * 0.35) if shy else pace
    bodies = [view[0].body()]
    long = pool is not None and seconds >= LONG_S
    for _ in range(count):
        parts = compound(rng, own, pool)
        motion = _mover_motion(rng, _place(rng, parts, view), slow, seconds, long=long)
        bodies.append(Body(parts, motion))
    for _ in range(int(rng.integers(2, 7)) if rng.random() < 0.8 else int(rng.integers(0, 2))):
        parts = compound(rng, family, pool)
        still = Motion(_place(rng, parts, view), random_rotation(rng) if rng.random() < 0.7 else np.eye(3))
        bodies.append(Body(_standing(parts, still), clutter=True))
    return tuple(bodies)


def _place(rng: np.random.Generator, parts: tuple[Part, ...], view: tuple[Room, F8, F8, float]) -> F8:
    """A place in view, nearer than the focus; some things stand on the floor or table."""
    room, position, axes, distance = view
    z = rng.uniform(0.35, 1.0) * min(distance, 1.2)
    at = position + axes @ (z * np.array([rng.uniform(-0.55, 0.55), rng.uniform(-0.4, 0.4), 1.0]))
    bottom = size_of(parts)[2]
    at[2] = room.support + bottom if rng.random() < 0.25 else max(at[2], bottom)
    return at


def _standing(parts: tuple[Part, ...], pose: Motion) -> tuple[Part, ...]:
    """Parts moved into the world."""
    turn, at = pose.rotation, pose.position
    return tuple(
        Part(p.shape, p.half, at + turn @ p.position, turn @ p.rotation, p.surface, openings=p.openings) for p in parts
    )


def _mover_motion(rng: np.random.Generator, at: F8, pace: Pace, seconds: float, *, long: bool) -> Motion:
    """It wanders or is thrown, turns, and may rest for a while; slower or faster than what is behind it."""
    zero_s, speed = float(rng.uniform(0, seconds)), pace.mover * math.exp(rng.normal() * 0.5)
    if rng.random() < 0.12 and not long:
        moves: Curve = Throw(rng.normal(size=3) * speed + (0, 0, 0.5), zero_s)
    else:
        moves = wander(rng, speed, _band((0.3, 3.0), speed, REACH, long=long), zero_s=zero_s)
    turns = wander(rng, rng.choice([0.2, 1.0, 3.0]) * math.exp(rng.normal() * 0.4), (0.3, 3.0), zero_s=zero_s)
    rest = _rest(rng, seconds) if rng.random() < RESTING_MOVER else None
    return Motion(at, random_rotation(rng), (moves,), turns, rest)
