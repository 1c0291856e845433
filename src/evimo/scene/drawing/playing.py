"""How people play with toys before a camera: pulled, driven, carried, swung, tossed and flown, where they are seen."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evimo.scene.bodies import Body, Part
from evimo.scene.drawing.carriers import Thing, frame_along, hand_at
from evimo.scene.drawing.gestures import Swing, Toss, trembling
from evimo.scene.drawing.objects import OVERLAP, reach, rod, size_of
from evimo.scene.drawing.orbits import Heading, Orbit
from evimo.scene.drawing.paint import Paint
from evimo.scene.drawing.space import Box, is_free, stays_inside, stays_on_stage, way_of
from evimo.scene.drawing.things import View, turned_parts
from evimo.scene.drawing.toys import LARGEST, SMALLEST, outline, scaled, toy
from evimo.scene.meshes.bank import MeshBank
from evimo.scene.motion import GRAVITY, Curve, Motion, random_rotation, rotation_from_vector, turned, wander

F8 = NDArray[np.float64]

PICTURE = 346 * 260 / 258.0**2  # area of EV-IMO's picture on the plane Z = 1
AREA = (0.012, 0.034)  # of the picture, of a toy at its mean place, with what carries it
NEAREST, FARTHEST = 0.5, 2.0  # m, depth of its mean place
BESIDE, ABOVE = 0.42, 0.3  # of the plane Z = 1, where mean places are
SLICE_PX = 40 / 258.0  # rate on the plane Z = 1, 1/s, of a pixel per slice of 25 ms
FASTEST = 2.2  # m/s
TRIES, DRAWN_WAYS, GLANCES = 30, 3, 20
GROUND_TRIES = 40
LONG_S = 2.0  # from here on what moves goes round about its place
HAND_SHARE = 0.55  # of the area, of what a hand holds: the rest is hand and forearm
BARE, ARM = (0.1, 0.24), (0.32, 0.65)  # m, of a forearm without sleeve, and of arms
VIEW = (0.8, 0.62)  # half sizes of the plane Z = 1 that an arm leaves, with a margin for how it moves
STRING = (0.0008, 0.0015)  # m, radius of a string
WAYS = {
    "boxes": {"rolling": 0.25, "hand": 0.25, "string": 0.25, "tossed": 0.2, "flying": 0.1},
    "floor": {"rolling": 0.6, "hand": 0.15, "string": 0.1, "tossed": 0.15, "flying": 0.05},
    "wall": {"hand": 0.35, "string": 0.3, "tossed": 0.25, "flying": 0.15},
    "table": {"rolling": 0.6, "hand": 0.15, "string": 0.15, "tossed": 0.1, "flying": 0.05},
    "tabletop": {"rolling": 0.55, "hand": 0.2, "string": 0.15, "tossed": 0.1, "flying": 0.05},
}
"""How toys are moved in each kind of room, in shares of those ways that suit them."""
SUITED = {
    "rolling": ("car", "cup", "robot", "tower", "plane"),
    "hand": ("car", "plane", "cup", "robot", "tower", "ball"),
    "string": ("car", "plane", "cup", "robot", "ball", "drone"),
    "tossed": ("ball", "plane", "robot"),
    "flying": ("drone", "plane"),
}


ANY_TOY = ("hand", "string")  # ways that suit the user's own meshes, too


@dataclass(frozen=True, slots=True)
class Play:
    """What a scene's movers are drawn for.

    view, kind: of the room. camera: its motion. pixels: least and most residual motion, px per slice of 25 ms.
    """

    view: View
    kind: str
    paint: Paint
    camera: Motion
    pixels: tuple[float, float]
    seconds: float
    meshes: MeshBank | None = None


@dataclass(frozen=True, slots=True)
class Played:
    """A toy with what carries it, and its motion."""

    thing: Thing
    motion: Motion
    kind: str

    def body(self) -> Body:
        """It as a mover."""
        return Body(self.thing.parts, self.motion, kind=self.kind)


def played(rng: np.random.Generator, play: Play, kind: str, taken: Sequence[Box]) -> Played:
    """A toy of this kind on the move: in view, in the room and through nothing, or the best of many tries.

    In one of the ways that suit it; in others only if there is no room for that.
    """
    suited = {how: share for how, share in WAYS[play.kind].items() if kind in SUITED[how] or how in ANY_TOY}
    best, most = None, -math.inf
    for _ in range(DRAWN_WAYS):
        total = sum(suited.values())
        how = str(rng.choice(list(suited), p=[share / total for share in suited.values()]))
        for _ in range(TRIES):
            candidate = _try(rng, play, kind, how)
            value = _value(candidate, play, taken)
            if value > most:
                best, most = candidate, value
            if value >= 1:
                return candidate
    assert best is not None
    return best


def _try(rng: np.random.Generator, play: Play, kind: str, how: str) -> Played:
    thing = placed_toy(rng, play, kind, how)
    z = float((thing.at - play.view.position) @ play.view.axes[:, 2])
    rate = math.exp(rng.uniform(*np.log(play.pixels))) * SLICE_PX
    return Played(*_MOVED[how](rng, play, thing, min(rate * z, FASTEST)), kind)


def placed_toy(rng: np.random.Generator, play: Play, kind: str, how: str) -> Thing:
    """A toy at its mean place, as large and as far as its share of the picture asks."""
    view, area = play.view, math.exp(rng.uniform(*np.log(AREA))) * (HAND_SHARE if how == "hand" else 1.0)
    parts = turned_parts(toy(rng, play.paint, kind, play.meshes), _attitude(rng, how, view))
    ray = _ground_ray(rng, view) if how == "rolling" else _ray(rng, view)
    seen = outline(parts, ray / np.linalg.norm(ray)) / PICTURE
    z = math.sqrt(seen / area) * math.exp(rng.uniform(math.log(SMALLEST), math.log(LARGEST)))
    if how == "rolling":
        drop = view.position[2] - view.room.support
        z = float(drop / -ray[2]) if ray[2] < -0.05 else FARTHEST
    z = float(np.clip(z, NEAREST, FARTHEST))
    length = float(np.clip(z * math.sqrt(area / seen), SMALLEST, LARGEST))
    parts, at = scaled(parts, length), view.position + z * ray
    half = size_of(parts, play.meshes)
    bottom = view.room.support + half[2] + 0.002
    at[2] = bottom if how == "rolling" else max(at[2], bottom + 0.02)
    return Thing(parts, at, half, how, own=len(parts))


def _ray(rng: np.random.Generator, view: View) -> F8:
    return view.axes @ (rng.uniform(-BESIDE, BESIDE), rng.uniform(-ABOVE, ABOVE), 1.0)


def _ground_ray(rng: np.random.Generator, view: View) -> F8:
    """To a place on the floor or table in view, if there is one; (3,), of depth 1."""
    low, high = np.maximum(view.room.stage[0], -view.room.half[:2]), np.minimum(view.room.stage[1], view.room.half[:2])
    ray = _ray(rng, view)
    for _ in range(GROUND_TRIES):
        at = np.array([*rng.uniform(low, high), view.room.support])
        seen = view.axes.T @ (at - view.position)
        x, y, z = seen / max(seen[2], 1e-3)
        if abs(x) < BESIDE and abs(y) < ABOVE and NEAREST < seen[2] < FARTHEST:
            return view.axes @ (x, y, z)
    return ray


def _attitude(rng: np.random.Generator, how: str, view: View) -> F8:
    """World from toy: upright, tilted in a hand, any way up in the air; rolling ones face where they go later."""
    if how == "tossed":
        return random_rotation(rng)
    tilt = {"rolling": 0.0, "hand": 0.35, "string": 0.12, "flying": 0.15}[how]
    if how == "rolling":
        return turned(_heading(rng, view))
    return turned(rng.uniform(0, 2 * math.pi)) @ rotation_from_vector(rng.normal(size=3) * tilt)


def _heading(rng: np.random.Generator, view: View) -> float:
    """Across the picture rather than along the line of sight."""
    right = view.axes[:, 0]
    return math.atan2(right[1], right[0]) + rng.normal() * 0.45 + math.pi * int(rng.integers(2))


def _value(candidate: Played, play: Play, taken: Sequence[Box]) -> float:
    """1 and more for what can stay, less for what is out of sight, passes through something or leaves its table."""
    thing, motion, view = candidate.thing, candidate.motion, play.view
    times = np.linspace(0, play.seconds, GLANCES)
    camera, own = play.camera.at(times), motion.at(times)
    seen = np.einsum("tji,tj->ti", camera.rotation, own.position - camera.position)
    z = np.maximum(seen[:, 2], 1e-3)
    inside = (np.abs(seen[:, 0]) < 0.58 * z) & (np.abs(seen[:, 1]) < 0.44 * z) & (z > 0.4) & (z < 2.4)
    way = way_of(motion, min(play.seconds, 8.0))
    value = float(inside.mean()) + 0.1
    value -= 0.5 * (not is_free(Box(way, thing.half), taken))
    value -= 1.0 * (not stays_inside(way, thing.half, view.room))
    return value - 0.7 * (thing.how == "rolling" and not stays_on_stage(way, view.room))


def _orbit(
    rng: np.random.Generator, play: Play, axes: tuple[F8, F8], speed: float, *, reach_m: tuple[float, float]
) -> Orbit:
    """About its place in a long scene; passing it at some time in a short one, on a wider way."""
    long = play.seconds >= LONG_S
    radius = rng.uniform(*reach_m) * (1.0 if long else 2.0)
    hz = float(np.clip(speed / (2 * math.pi * radius), 0.1, 1.3))
    ratio = float(rng.uniform(0.6, 1.0)) * (-1.0 if rng.random() < 0.5 else 1.0)
    scale = speed / math.sqrt(0.5 * (1 + ratio * ratio))
    orbit = Orbit(scale * axes[0], ratio * scale * axes[1], hz, float(rng.uniform(0, 2 * math.pi)), np.zeros(3))
    return orbit if long else replace(orbit, start=orbit(np.array([rng.uniform(0, play.seconds)]))[0][0])


def _rolling(rng: np.random.Generator, play: Play, thing: Thing, speed: float) -> tuple[Thing, Motion]:
    """Driven, or pulled by a thin string; it faces the way it goes, or slides."""
    front = thing.parts[0].rotation[:, 0] * (1, 1, 0)
    front = front / np.linalg.norm(front)
    orbit = _orbit(rng, play, (front, np.cross((0, 0, 1), front)), speed, reach_m=(0.12, 0.3))
    ratio = float(orbit.along @ np.cross((0, 0, 1), front) / (orbit.across @ front))
    turns: Curve = Heading(ratio, orbit.hz, orbit.phase)
    wide = float(np.hypot(*thing.half[:2]))
    if rng.random() < 0.3:
        turns = wander(rng, 0.4, (0.3, 2.0))
        turns = replace(turns, amplitude=turns.amplitude * (0, 0, 1))
    if rng.random() < 0.5:
        thing = _on_a_lead(rng, thing, front, play.paint)
    return replace(thing, half=np.array((wide, wide, thing.half[2]))), Motion(thing.at, np.eye(3), (orbit,), turns)


def _on_a_lead(rng: np.random.Generator, thing: Thing, front: F8, paint: Paint) -> Thing:
    way = front * math.cos(rise := rng.uniform(0.3, 0.9)) + np.array([0, 0, math.sin(rise)])
    start = front * reach(thing.parts[0].shape, thing.parts[0].half, thing.parts[0].rotation.T @ front)
    start = start + thing.parts[0].position
    string = rod(start, start + way * rng.uniform(0.4, 0.8), float(rng.uniform(*STRING)), paint.surface(rng, plain=1.0))
    return replace(thing, parts=(*thing.parts, string))


def _in_hand(rng: np.random.Generator, play: Play, thing: Thing, speed: float) -> tuple[Thing, Motion]:
    view, tilt = play.view, turned(rng.normal() * 0.4)
    axes = view.axes @ rotation_from_vector(rng.normal(size=3) * 0.25) @ tilt
    orbit = _orbit(rng, play, (axes[:, 0], axes[:, 1]), speed, reach_m=(0.08, 0.2))
    turns = wander(rng, rng.uniform(0.2, 0.9), (0.4, 2.5))
    if rng.random() < 0.7:
        turns = trembling(rng, turns, rng.uniform(0.05, 0.25))
    return _gripped(rng, thing, play), Motion(thing.at, np.eye(3), (orbit,), turns)


def _gripped(rng: np.random.Generator, thing: Thing, play: Play) -> Thing:
    """In a hand, whose arm comes from below or from the nearer side and, if it is long enough, leaves the picture."""
    axes, place = play.view.axes, play.view.axes.T @ (thing.at - play.view.position)
    way = np.array([math.copysign(rng.uniform(0.0, 1.3), place[0]), rng.uniform(0.4, 1.0), rng.uniform(-0.15, 0.35)])
    long = _length_in_view(place, way / np.linalg.norm(way))
    towards = axes @ way / np.linalg.norm(way)
    far = max(thing.parts, key=lambda part: float(part.position @ towards))
    grip = far.position + OVERLAP * reach(far.shape, far.half, far.rotation.T @ towards) * towards
    skin, sleeve = play.paint.surface(rng, plain=1.0), play.paint.surface(rng, plain=0.5)
    bare, thick = float(rng.uniform(*BARE)), float(rng.uniform(0.02, 0.026))
    hand = frame_along(rng, towards)
    wide = float(np.clip(reach(far.shape, far.half, far.rotation.T @ hand[:, 0]), 0.02, 0.05))
    arm: list[Part] = [
        rod(grip + 0.03 * towards, grip + (bare + 0.02) * towards, thick, skin),
        rod(grip + bare * towards, grip + long * towards, 1.25 * thick, sleeve),
    ]
    return replace(thing, parts=(*thing.parts, *hand_at(grip, hand, 0.8 * wide, skin), *arm))


def _length_in_view(place: F8, way: F8) -> float:
    """How far an arm along `way` from `place`, (3,) each in camera axes, goes until out of view, m, within ARM."""
    lengths = np.linspace(*ARM, 12)
    points = place + lengths[:, None] * way
    outside = (np.abs(points[:, :2]) > np.array(VIEW) * np.maximum(points[:, 2:], 0.1)).any(axis=1)
    return float(lengths[np.argmax(outside)] if outside.any() else lengths[-1])


def _on_string(rng: np.random.Generator, play: Play, thing: Thing, speed: float) -> tuple[Thing, Motion]:
    """Swung round and to and fro under the ceiling, or under a hand above the picture."""
    room = play.view.room
    room_above = max(2 * room.half[2] - float(thing.at[2]), 0.3)
    length, top = min(float(rng.uniform(0.7, 1.5)), room_above), np.array([0.0, 0.0, 0.8 * thing.half[2]])
    string = rod(top, np.array([0, 0, length]), float(rng.uniform(*STRING)), play.paint.surface(rng, plain=1.0))
    hung = replace(thing, parts=(*thing.parts, string), string=length)
    hz = math.sqrt(-GRAVITY[2] / length) / (2 * math.pi)
    aside = axes_level(rng, play.view)
    scale, ratio = min(speed / length, 0.6 * 2 * math.pi * hz), float(rng.uniform(0.45, 0.9)) * rng.choice([-1, 1])
    round_ = Orbit(scale * aside[1], ratio * scale * aside[0], hz, float(rng.uniform(0, 2 * math.pi)), np.zeros(3))
    swing = Swing(np.array([0.0, 0.0, -length]), round_)
    return hung, Motion(thing.at, np.eye(3), (swing,), round_)


def axes_level(rng: np.random.Generator, view: View) -> tuple[F8, F8]:
    """Level directions (3,) across the picture, roughly, and along the line of sight."""
    angle = _heading(rng, view)
    across = np.array([math.cos(angle), math.sin(angle), 0.0])
    return across, np.cross(np.array([0.0, 0.0, 1.0]), across)


def _tossed(rng: np.random.Generator, play: Play, thing: Thing, speed: float) -> tuple[Thing, Motion]:
    """To and fro between hands out of sight; its place is the middle of its way."""
    up, across = float(rng.uniform(1.0, 2.2)), axes_level(rng, play.view)[0]
    velocity = across * speed + (0, 0, up)
    flight_s = 2 * up / -GRAVITY[2]
    middle = 0.5 * flight_s * speed * across + (0, 0, up * up / -GRAVITY[2] / 3)
    toss = Toss(velocity, float(rng.uniform(0.08, 0.2)), -float(rng.uniform(0, flight_s)))
    return thing, Motion(thing.at - middle, np.eye(3), (toss,), wander(rng, rng.uniform(0.5, 3.0), (0.3, 1.5)))


def _flying(rng: np.random.Generator, play: Play, thing: Thing, speed: float) -> tuple[Thing, Motion]:
    axes = play.view.axes @ rotation_from_vector(rng.normal(size=3) * 0.3)
    orbit = _orbit(rng, play, (axes[:, 0], 0.6 * axes[:, 1] + 0.4 * axes[:, 2]), speed, reach_m=(0.12, 0.3))
    return thing, Motion(thing.at, np.eye(3), (orbit,), wander(rng, rng.uniform(0.2, 0.7), (0.3, 2.0)))


_MOVED = {
    "rolling": _rolling,
    "hand": _in_hand,
    "string": _on_string,
    "tossed": _tossed,
    "flying": _flying,
}
