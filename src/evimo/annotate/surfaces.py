"""The scans of a capture as flat arrays in blocks: what is out of view, or too fine to be seen, is passed over."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.annotate.discs import Discs, disc_levels
from evimo.captures.scans import Scan

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
I8 = NDArray[np.int64]

CHUNK, BLOCK = 1_024, 256  # discs or triangles: of a chunk, which has levels; of a block, which is in view or not


class Surfaces(NamedTuple):
    """The scans of B bodies: chunks of them, levels of these, blocks of these, and in the blocks discs or triangles.

    chunks:  (C, 3) body, first and last + 1 level. chunk_balls: (C, 4) centre and radius around all in it.
    levels:  (L, 2) first and last + 1 block, from fine to coarse. sizes: (L,) radius of its discs; 0 of triangles.
    blocks:  (K, 2) first and last + 1 disc or triangle. block_balls: (K, 4).
    solid:   (C,) whether the chunk's are triangles.
    discs:   (7, N) centre, normal and radius. corners: (T, 9) of the triangles. All in the bodies' own axes, m.
    """

    chunks: I8
    chunk_balls: F4
    levels: I8
    sizes: F4
    blocks: I8
    block_balls: F4
    solid: NDArray[np.bool_]
    discs: F4
    corners: F4


class _Rows:
    """Surfaces that grow."""

    def __init__(self) -> None:
        self.chunks: list[tuple[int, int, int]] = []
        self.chunk_balls: list[F4] = []
        self.levels: list[tuple[int, int]] = []
        self.sizes: list[float] = []
        self.blocks: list[tuple[int, int]] = []
        self.block_balls: list[F4] = []
        self.solid: list[bool] = []
        self.discs: list[Discs] = [Discs(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32), np.zeros(0, "f4"))]
        self.corners: list[F4] = [np.zeros((0, 9), np.float32)]
        self.disc_count, self.corner_count = 0, 0

    def add_blocks(self, corners: F8, reach: float, first: int) -> None:
        """Blocks of rows that are sorted in space; corners: (N, P, 3) points of each. reach: beyond them, m."""
        start = len(self.blocks)
        for at in range(0, len(corners), BLOCK):
            mine = corners[at : at + BLOCK].reshape(-1, 3)
            self.blocks.append((first + at, first + min(at + BLOCK, len(corners))))
            self.block_balls.append(_ball(mine, reach))
        self.levels.append((start, len(self.blocks)))

    def frozen(self) -> Surfaces:
        """All of it as arrays."""

        def whole(rows: Sequence[object], columns: int) -> I8:
            return np.array(rows, np.int64).reshape(-1, columns)

        centre, normal, radius = (np.concatenate(column) for column in zip(*self.discs, strict=True))
        return Surfaces(
            whole(self.chunks, 3),
            np.array(self.chunk_balls, np.float32).reshape(-1, 4),
            whole(self.levels, 2),
            np.array(self.sizes, np.float32),
            whole(self.blocks, 2),
            np.array(self.block_balls, np.float32).reshape(-1, 4),
            np.array(self.solid, np.bool_),
            np.concatenate((centre.T, normal.T, radius[None])),
            np.concatenate(self.corners),
        )


def surfaces_of(scans: Sequence[Scan]) -> Surfaces:
    """The scans of bodies 0, 1, … as arrays; of a million points it takes about 20 s."""
    rows = _Rows()
    for body, scan in enumerate(scans):
        (_add_cloud if scan.is_cloud else _add_mesh)(rows, body, scan)
    return rows.frozen()


def _add_cloud(rows: _Rows, body: int, scan: Scan) -> None:
    chunks = _chunks(scan.points)
    chunk_of = np.empty(len(scan.points), np.int32)
    for number, chunk in enumerate(chunks):
        chunk_of[chunk] = number
    levels = [(discs, _groups(chunk_of[index], len(chunks))) for discs, index in disc_levels(scan.points)]
    for number, chunk in enumerate(chunks):
        first = len(rows.levels)
        for discs, groups in levels:
            kept = groups[number]
            if not len(kept):
                continue
            kept = kept[_curve(discs.centre[kept])]
            part = Discs(*(column[kept] for column in discs))
            rows.add_blocks(part.centre[:, None].astype(np.float64), float(part.radius.max()), rows.disc_count)
            rows.sizes.append(float(np.median(part.radius)))
            rows.discs.append(part)
            rows.disc_count += len(kept)
        rows.chunks.append((body, first, len(rows.levels)))
        rows.chunk_balls.append(_ball(scan.points[chunk], float(rows.discs[-1].radius.max())))
        rows.solid.append(False)


def _groups(numbers: NDArray[np.int32], count: int) -> list[I8]:
    """The places of each of the numbers 0 to count - 1."""
    order = np.argsort(numbers, kind="stable")
    return np.split(order, np.searchsorted(numbers[order], np.arange(1, count)))


def _add_mesh(rows: _Rows, body: int, scan: Scan) -> None:
    corners = scan.points[scan.triangles]
    middle = corners.mean(axis=1)
    for chunk in _chunks(middle):
        kept = chunk[_curve(middle[chunk])]
        rows.chunks.append((body, len(rows.levels), len(rows.levels) + 1))
        rows.add_blocks(corners[kept], 0.0, rows.corner_count)
        rows.sizes.append(0.0)
        rows.chunk_balls.append(_ball(corners[kept].reshape(-1, 3), 0.0))
        rows.solid.append(True)
        rows.corners.append(corners[kept].reshape(-1, 9).astype(np.float32))
        rows.corner_count += len(kept)


def _chunks(points: F8) -> list[I8]:
    """Indices of points, cut in halves along the longest side until each part is small."""
    waiting, done = [np.arange(len(points))], list[I8]()
    while waiting:
        index = waiting.pop()
        if len(index) <= CHUNK:
            done.append(index)
            continue
        axis = int(np.ptp(points[index], axis=0).argmax())
        order = np.argpartition(points[index, axis], len(index) // 2)
        waiting += [index[order[len(index) // 2 :]], index[order[: len(index) // 2]]]
    return done


def _curve(points: NDArray[np.floating]) -> I8:
    """The order of points along a curve that fills space (Morton's), so that neighbours in it are neighbours."""
    low, side = points.min(axis=0), float(np.ptp(points, axis=0).max()) or 1.0
    cell = ((points - low) * (1023 / side)).astype(np.int64)
    key = np.zeros(len(points), np.int64)
    for bit in range(10):
        for axis in range(3):
            key |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(key, kind="stable")


def _ball(points: F8, reach: float) -> F4:
    """A ball around points (N, 3) and what reaches beyond them: centre and radius."""
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    radius = float(np.linalg.norm(points - centre, axis=1).max()) + reach
    return np.array((*centre, radius * (1 + 1e-6) + 1e-6), np.float32)
