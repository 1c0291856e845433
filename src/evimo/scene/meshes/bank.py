"""Triangle meshes as flat arrays with a tree for rays: what a user's own objects become."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.scene.meshes.trees import corner_normals, escapes, grow

F4 = NDArray[np.float32]
I4 = NDArray[np.int32]
F8 = NDArray[np.float64]
I8 = NDArray[np.int64]
Triangles = tuple[F8, I8]
"""Vertices (V, 3) in any unit, and triangles (T, 3) of their indices."""

CREASE = 0.77  # cosine of 40 degrees: normals of triangles that differ more do not mix


class MeshBank(NamedTuple):
    """Meshes, each in its own unit space: centred, from -1 to 1 along its longest axis, proportions kept.

    A part shows mesh m with `half` = (s, s, s), s being half its longest length in m.

    corners: (T, 9) x, y, z of three corners of all triangles. normals: (T, 9) unit, at the corners.
    boxes:   (N, 6) of the trees' nodes, low x, y, z and high x, y, z.
    nodes:   (N, 4) first triangle and how many (0: no leaf), second child (the first is the next row), axis of the cut.
    misses:  (8, N) the node to go on with, by octant of the ray's direction; -1 at the end.
    roots:   (M,) first node of each mesh. extent: (M, 3) half sizes, the largest is 1. radius: (M,) around the centre.
    """

    corners: F4
    normals: F4
    boxes: F4
    nodes: I4
    misses: I4
    roots: I4
    extent: F4
    radius: F4

    @property
    def number(self) -> int:
        """How many meshes."""
        return len(self.roots)


def mesh_bank(meshes: Sequence[Triangles]) -> MeshBank:
    """The bank of meshes given as vertices and triangles; triangles without area are left out.

    Raises:
        ValueError: a mesh without any triangle of some area.
    """
    banks, nodes, triangles = [], 0, 0
    for vertices, faces in meshes:
        bank = _single(vertices, faces)
        leaf = bank.nodes[:, 1] > 0
        bank.nodes[leaf, 0] += triangles
        bank.nodes[~leaf, 2] += nodes
        bank.misses[bank.misses >= 0] += nodes
        banks.append(bank._replace(roots=bank.roots + np.int32(nodes)))
        nodes, triangles = nodes + len(bank.nodes), triangles + len(bank.corners)
    if not banks:
        return _empty()
    columns = zip(MeshBank._fields, zip(*banks, strict=True), strict=True)
    return MeshBank(*(np.concatenate(each, axis=1 if name == "misses" else 0) for name, each in columns))


def in_unit_space(vertices: F8, triangles: I8) -> tuple[F4, I8]:
    """Vertices there, each once, and those triangles that have some area.

    Raises:
        ValueError: there is none.
    """
    used, corners = np.unique(vertices[triangles.ravel()], axis=0, return_inverse=True)
    if len(used) < 3:
        raise ValueError("no triangle of any area")
    low, high = used.min(axis=0), used.max(axis=0)
    unit = ((used - (low + high) / 2) / ((high - low).max() / 2)).astype(np.float32)
    triangles = corners.reshape(-1, 3)
    solid = (_areas(unit, triangles) != 0).any(axis=1)
    if not solid.any():
        raise ValueError("no triangle of any area")
    return unit, triangles[solid]


def _areas(vertices: F4, triangles: I8) -> F8:
    """As vectors (T, 3), twice as long."""
    a, b, c = (vertices[triangles[:, corner]].astype(np.float64) for corner in range(3))
    return np.cross(b - a, c - a)


def _single(vertices: F8, triangles: I8) -> MeshBank:
    unit, triangles = in_unit_space(vertices, triangles)
    normals = corner_normals(_areas(unit, triangles), triangles, len(unit), CREASE)
    corners = unit[triangles]
    boxes, nodes, order = grow(np.concatenate((corners.min(axis=1), corners.max(axis=1)), axis=1))
    extent, radius = np.abs(unit).max(axis=0, keepdims=True), np.linalg.norm(unit, axis=1).max(keepdims=True)
    rows = np.ascontiguousarray(corners.reshape(-1, 9)[order])
    return MeshBank(rows, normals[order], boxes, nodes, escapes(nodes), np.zeros(1, np.int32), extent, radius)


def _empty() -> MeshBank:
    def none(*shape: int) -> F4:
        return np.zeros(shape, np.float32)

    whole = np.int32
    return MeshBank(
        none(0, 9),
        none(0, 9),
        none(0, 6),
        np.zeros((0, 4), whole),
        np.zeros((8, 0), whole),
        np.zeros(0, whole),
        none(0, 3),
        none(0),
    )


NO_MESHES = _empty()
