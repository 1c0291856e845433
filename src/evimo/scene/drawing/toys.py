"""Toys as EV-IMO's are: cars, planes, cups, balls, towers of blocks, robots and drones, of a few primitives each."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evimo.scene.bodies import BOX, CYLINDER, ELLIPSOID, MESH, Part, Surface
from evimo.scene.drawing.objects import MESHES
from evimo.scene.drawing.paint import Paint
from evimo.scene.meshes.bank import MeshBank
from evimo.scene.motion import axes_along, turned

F8 = NDArray[np.float64]
Triple = tuple[float, float, float]

SMALLEST, LARGEST = 0.1, 0.3  # longest side, m
THINNEST = 0.003  # half size, m
UNSEEN = ("tower", "drone")  # kinds that the test part alone has
ACROSS = axes_along(np.array([0.0, 1.0, 0.0]))  # of cylinders whose axis is y
ALONG = axes_along(np.array([1.0, 0.0, 0.0]))
SAMPLES, CELLS = 3000, 24  # rays' worth of points and cells along the longest side, for the size of an outline


@dataclass(frozen=True, slots=True)
class Piece:
    """A primitive of a toy: x is forward, z up; lengths are relative, and pieces of one `coat` are painted alike."""

    shape: int
    half: Triple
    at: Triple
    coat: int = 0
    rotation: F8 | None = None


def toy(rng: np.random.Generator, paint: Paint, kind: str, meshes: MeshBank | None = None) -> tuple[Part, ...]:
    """One toy of a kind about its own middle, x forward and z up, whose longest side is 1 m; see `scaled`.

    kind: one of KINDS, or `mesh N` for the N-th of the user's own.
    """
    if kind not in KINDS:
        assert meshes is not None
        return (Part(MESH, np.full(3, 0.5), np.zeros(3), np.eye(3), paint.surface(rng), mesh=int(kind.split()[1])),)
    stretch = np.exp(rng.normal(size=3) * 0.1)
    stretch[1] = stretch[0] if kind in ("cup", "ball", "drone") else stretch[1]
    coats: dict[int, Surface] = {}
    parts = []
    for piece in KINDS[kind](rng):
        turn = np.eye(3) if piece.rotation is None else piece.rotation
        surface = coats.setdefault(piece.coat, paint.surface(rng))
        half = np.array(piece.half) * (stretch if piece.rotation is None else 1.0)
        parts.append(Part(piece.shape, half, np.array(piece.at) * stretch, turn, surface))
    corners = [part.position + sign * np.abs(part.rotation) @ part.half for part in parts for sign in (-1, 1)]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    centred = tuple(replace(part, position=part.position - (low + high) / 2) for part in parts)
    return scaled(centred, 1 / float((high - low).max()))


def scaled(parts: tuple[Part, ...], scale: float) -> tuple[Part, ...]:
    """The same toy so many times as large; nothing gets thinner than a sheet of card."""
    return tuple(
        replace(part, half=np.maximum(part.half * scale, THINNEST), position=part.position * scale) for part in parts
    )


def drawn_kind(part: str | None, meshes: MeshBank | None, rng: np.random.Generator) -> str:
    """One kind that this part of a data set may have; of the user's own meshes each part has every other one."""
    if meshes is not None and meshes.number and rng.random() < MESHES:
        parity = None if part is None else int(part == "test")
        kept = [m for m in range(meshes.number) if parity is None or m % 2 == parity] or [0]
        return f"mesh {rng.choice(kept)}"
    return str(rng.choice([kind for kind in KINDS if part == "test" or kind not in UNSEEN]))


def is_seen(kind: str, part: str | None) -> bool:
    """Whether toys of this kind are in training, too."""
    return part != "test" or (kind in KINDS and kind not in UNSEEN)


def outline(parts: tuple[Part, ...], way: F8) -> float:
    """Area of a toy seen from afar along the unit vector `way`, m²: cells that points on its surface fall into."""
    rng = np.random.default_rng(0)
    points = np.concatenate([_points_on(rng, part) for part in parts]) @ axes_along(way)[:, :2]
    side = float(np.ptp(points, axis=0).max()) / CELLS
    return len(np.unique(np.floor(points / side).astype(np.int64), axis=0)) * side * side * (1 - 1.0 / CELLS)


def _points_on(rng: np.random.Generator, part: Part) -> F8:
    """Points (N, 3) that fill a primitive."""
    points = rng.uniform(-1, 1, (SAMPLES, 3))
    if part.shape in (ELLIPSOID, MESH):
        points = points[(points**2).sum(axis=1) < 1]
    elif part.shape == CYLINDER:
        points = points[(points[:, :2] ** 2).sum(axis=1) < 1]
    return part.position + (points * part.half) @ part.rotation.T


def _car(rng: np.random.Generator) -> list[Piece]:
    wheel, high = float(rng.uniform(0.09, 0.13)), float(rng.uniform(0.09, 0.14))
    cabin, back = float(rng.uniform(0.18, 0.28)), float(rng.uniform(-0.18, 0.05))
    wheels = [
        Piece(CYLINDER, (wheel, wheel, 0.04), (x, y, wheel), 2, ACROSS) for x in (-0.3, 0.3) for y in (-0.23, 0.23)
    ]
    body = Piece(BOX, (0.5, 0.22, high), (0.0, 0.0, wheel + high))
    return [body, Piece(BOX, (cabin, 0.19, 0.11), (back, 0.0, wheel + 2 * high + 0.1), 1), *wheels]


def _plane(rng: np.random.Generator) -> list[Piece]:
    thick, span, chord = float(rng.uniform(0.08, 0.11)), float(rng.uniform(0.42, 0.55)), float(rng.uniform(0.1, 0.15))
    height = float(rng.choice([-0.4, 0.7])) * thick
    return [
        Piece(ELLIPSOID, (0.5, thick, thick), (0.0, 0.0, 0.0)),
        Piece(BOX, (chord, span, 0.018), (0.08, 0.0, height), 1),
        Piece(BOX, (0.07, 0.2, 0.015), (-0.42, 0.0, 0.04), 1),
        Piece(BOX, (0.08, 0.015, 0.1), (-0.43, 0.0, 0.12), 2),
    ]


def _cup(rng: np.random.Generator) -> list[Piece]:
    wide, thick, high = float(rng.uniform(0.28, 0.38)), 0.045, 0.45
    out = wide + 0.17
    return [
        Piece(CYLINDER, (wide, wide, high), (0.0, 0.0, 0.0)),
        Piece(CYLINDER, (0.88 * wide, 0.88 * wide, 0.01), (0.0, 0.0, high), 1),
        Piece(CYLINDER, (thick, thick, 0.11), (wide + 0.08, 0.0, 0.24), 0, ALONG),
        Piece(CYLINDER, (thick, thick, 0.11), (wide + 0.08, 0.0, -0.2), 0, ALONG),
        Piece(CYLINDER, (thick, thick, 0.25), (out, 0.0, 0.02)),
    ]


def _ball(rng: np.random.Generator) -> list[Piece]:
    return [Piece(ELLIPSOID, (0.5, 0.5, 0.5), (0.0, 0.0, 0.0))]


def _tower(rng: np.random.Generator) -> list[Piece]:
    pieces, top = [], 0.0
    for k in range(int(rng.integers(3, 6))):
        half = float(rng.uniform(0.16, 0.24)) * 0.92**k
        high = float(rng.uniform(0.09, 0.16))
        at = (float(rng.normal() * 0.02), float(rng.normal() * 0.02), top + high)
        pieces.append(Piece(BOX, (half, half * float(rng.uniform(0.7, 1.0)), high), at, k, turned(rng.normal() * 0.3)))
        top += 2 * high
    return pieces


def _robot(rng: np.random.Generator) -> list[Piece]:
    wide, head = float(rng.uniform(0.15, 0.2)), int(rng.choice([BOX, ELLIPSOID]))
    lift = float(rng.uniform(-0.4, 0.6))
    limbs = [Piece(BOX, (0.055, 0.06, 0.16), (0.0, y, 0.16), 2) for y in (-0.09, 0.09)]
    tilt = axes_along(np.array([math.sin(lift), 0.0, math.cos(lift)]))
    limbs += [Piece(CYLINDER, (0.045, 0.045, 0.15), (0.02, y * (wide + 0.05), 0.47), 2, tilt) for y in (-1, 1)]
    torso = Piece(BOX, (0.11, wide, 0.17), (0.0, 0.0, 0.49))
    return [torso, Piece(head, (0.11, 0.12, 0.11), (0.0, 0.0, 0.78), 1), *limbs]


def _drone(rng: np.random.Generator) -> list[Piece]:
    disc, arm = float(rng.uniform(0.15, 0.2)), float(rng.uniform(0.25, 0.32))
    arms = [Piece(BOX, (math.sqrt(2) * arm, 0.03, 0.02), (0.0, 0.0, 0.02), 1, turned(k * math.pi / 4)) for k in (1, 3)]
    discs = [Piece(CYLINDER, (disc, disc, 0.02), (x * arm, y * arm, 0.07), 2) for x in (-1, 1) for y in (-1, 1)]
    return [Piece(BOX, (0.2, 0.14, 0.08), (0.0, 0.0, 0.0)), *arms, *discs]


KINDS: dict[str, Callable[[np.random.Generator], list[Piece]]] = {
    "car": _car,
    "plane": _plane,
    "cup": _cup,
    "ball": _ball,
    "robot": _robot,
    "tower": _tower,
    "drone": _drone,
}
