"""Simulated bodies as triangles, as a scanner would give them."""

import numpy as np
import trimesh
from numpy.typing import NDArray

from evimo.scene.bodies import BOX, CYLINDER, ELLIPSOID, GRATING, Body, Part
from evimo.scene.meshes.bank import MeshBank, Triangles

F8 = NDArray[np.float64]

ROUNDED = 4  # times that an icosahedron's triangles are cut in four: the sphere is then right to 0.2 % of its radius
SIDES = 64  # of a round cylinder: right to 0.1 %


def body_triangles(bodies: tuple[Body, ...], meshes: MeshBank) -> Triangles:
    """The surface of bodies together: vertices (V, 3) in their own axes, m, and triangles (T, 3).

    Parts that stand within others stay whole.
    """
    pieces = [_part_triangles(part, meshes) for body in bodies for part in body.parts]
    first = np.cumsum([0, *(len(vertices) for vertices, _ in pieces)])
    vertices = np.concatenate([vertices for vertices, _ in pieces])
    return vertices, np.concatenate([triangles + at for (_, triangles), at in zip(pieces, first, strict=False)])


def _part_triangles(part: Part, meshes: MeshBank) -> Triangles:
    vertices, triangles = _unit_triangles(part, meshes)
    return (vertices * part.half) @ part.rotation.T + part.position, triangles


def _unit_triangles(part: Part, meshes: MeshBank) -> Triangles:
    """In the part's unit space, from -1 to 1."""
    match part.shape:
        case shape if shape == BOX:
            return _of(trimesh.creation.box((2, 2, 2)))
        case shape if shape == ELLIPSOID:
            return _of(trimesh.creation.icosphere(ROUNDED, 1.0))
        case shape if shape == CYLINDER:
            return _of(trimesh.creation.cylinder(1.0, 2.0, sections=SIDES))
        case shape if shape == GRATING:
            return _bars(part.openings)
        case _:
            return _mesh(part.mesh, meshes)


def _of(mesh: trimesh.Trimesh) -> Triangles:
    return np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)


def _bars(openings: tuple[float, float, float, float]) -> Triangles:
    """The bars of a net in its plane z = 0, as flat strips; each begins a pitch with its share of it."""
    rectangles: list[tuple[float, float, float, float]] = []
    for axis in (0, 1):
        pitch, share = 1 / openings[axis], openings[2 + axis]
        for number in range(int(np.ceil(2 / pitch))):
            low, high = number * pitch - 1, min((number + share) * pitch - 1, 1.0)
            rectangles.append((low, high, -1.0, 1.0) if axis == 0 else (-1.0, 1.0, low, high))
    corners = [((a, c, 0.0), (b, c, 0.0), (b, d, 0.0), (a, d, 0.0)) for a, b, c, d in rectangles]
    square = np.array([[0, 1, 2], [0, 2, 3]], np.int64)
    return np.array(corners).reshape(-1, 3), np.concatenate([square + 4 * k for k in range(len(corners))])


def _mesh(number: int, meshes: MeshBank) -> Triangles:
    """One of the scene's meshes, from the leaves of its tree."""
    last = meshes.roots[number + 1] if number + 1 < len(meshes.roots) else len(meshes.nodes)
    nodes = meshes.nodes[meshes.roots[number] : last]
    leaves = nodes[nodes[:, 1] > 0]
    rows = np.concatenate([np.arange(first, first + count) for first, count, *_ in leaves.tolist()])
    return meshes.corners[rows].reshape(-1, 3).astype(np.float64), np.arange(3 * len(rows)).reshape(-1, 3)
