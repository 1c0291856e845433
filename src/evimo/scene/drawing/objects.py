"""Things the size of a hand or a shoebox: movers and static clutter come from this one family."""

import math

import numpy as np
from numpy.typing import NDArray

from evimo.scene.bodies import BOX, CYLINDER, ELLIPSOID, MESH, Part, Surface
from evimo.scene.drawing.paint import Paint
from evimo.scene.drawing.pools import Pool
from evimo.scene.meshes.bank import MeshBank
from evimo.scene.motion import axes_along, random_rotation

F8 = NDArray[np.float64]
SMALLEST, LARGEST = 0.1, 0.3  # overall length, m: the scans of EV-IMO's objects reach 0.12 to 0.26
OVERLAP = 0.85  # of the distance at which two parts just touch
MESHES = 0.4  # share of things that are the user's, if there are any


def compound(
    rng: np.random.Generator, paint: Paint, pool: Pool | None = None, meshes: MeshBank | None = None
) -> tuple[Part, ...]:
    """One to five parts that touch, about the origin; of a family that the pool holds, if there is one.

    Or one of the user's meshes; of two pools each has every other one, if there are several.
    """
    if meshes is not None and meshes.number and rng.random() < MESHES:
        kept = [m for m in range(meshes.number) if pool is None or m % 2 == pool.parity] or [0]
        half = np.full(3, _length(rng) / 2)
        return (Part(MESH, half, np.zeros(3), np.eye(3), paint.surface(rng), mesh=int(rng.choice(kept))),)
    while True:
        parts = _compound(rng, paint)
        if pool is None or pool.holds(part.shape for part in parts):
            return parts


def _length(rng: np.random.Generator) -> float:
    return math.exp(rng.uniform(math.log(SMALLEST), math.log(LARGEST)))


def _compound(rng: np.random.Generator, paint: Paint) -> tuple[Part, ...]:
    shapes: list[tuple[int, F8, F8, F8]] = []
    for _ in range(int(rng.integers(1, 6))):
        shape = int(rng.choice([BOX, ELLIPSOID, CYLINDER], p=[0.4, 0.35, 0.25]))
        half = np.exp(rng.uniform(math.log(0.25), 0, 3))
        half = np.array((half[0], half[0], half[2])) if shape == CYLINDER and rng.random() < 0.7 else half
        rotation = random_rotation(rng) if rng.random() < 0.5 else np.eye(3)
        position = np.zeros(3)
        if shapes:
            onto = shapes[rng.integers(len(shapes))]
            way = random_rotation(rng)[0]
            gap = reach(onto[0], onto[1], onto[2].T @ way) + reach(shape, half, rotation.T @ way)
            position = onto[3] + OVERLAP * gap * way
        shapes.append((shape, half, rotation, position))
    corners = [position + np.abs(rotation) @ half * sign for _, half, rotation, position in shapes for sign in (-1, 1)]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    scale = _length(rng) / (high - low).max()
    middle = (low + high) / 2
    same = paint.surface(rng)
    return tuple(
        Part(
            shape,
            np.maximum(half * scale, 0.004),
            (position - middle) * scale,
            rotation,
            same if rng.random() < 0.3 else paint.surface(rng),
        )
        for shape, half, rotation, position in shapes
    )


def reach(shape: int, half: F8, way: F8) -> float:
    """From the centre of a primitive to its surface along the unit vector `way` in its own axes, m."""
    if shape == BOX:
        return float(1 / np.max(np.abs(way) / half))
    if shape in (ELLIPSOID, MESH):  # of a mesh, a guess
        return float(1 / np.linalg.norm(way / half))
    return float(1 / max(np.hypot(way[0] / half[0], way[1] / half[1]), abs(way[2]) / half[2]))


def rod(start: F8, stop: F8, thick: float, surface: Surface) -> Part:
    """A cylinder of radius `thick` m from `start` to `stop`, (3,) each."""
    way = stop - start
    long = float(np.linalg.norm(way))
    return Part(CYLINDER, np.array((thick, thick, long / 2)), (start + stop) / 2, axes_along(way / long), surface)


def size_of(parts: tuple[Part, ...], meshes: MeshBank | None = None) -> F8:
    """Half sizes (3,) of the axis-parallel box around a compound, m."""
    halves = [part.half * meshes.extent[part.mesh] if meshes and part.mesh >= 0 else part.half for part in parts]
    far = [np.abs(part.position) + np.abs(part.rotation) @ half for part, half in zip(parts, halves, strict=True)]
    return np.max(far, axis=0)
