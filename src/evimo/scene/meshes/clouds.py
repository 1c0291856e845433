"""Surfaces of scans: a closed mesh around a cloud of points, as scanners give without triangles."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, label
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree
from skimage.measure import marching_cubes

F8 = NDArray[np.float64]
I8 = NDArray[np.int64]

CELLS = 44  # along the longest side: meshes of 10,000 to 30,000 triangles
LEAST_POINTS, MOST_POINTS = 100, 80_000  # of more, every so many
NEIGHBOURS = 12
ISOLATED = 4.0  # medians of the distance to neighbours beyond which a point is noise
REACH = 1.5  # cells around a point that are taken as filled, at least
THIN = 0.3  # cells from a sheet of points to each side of the wall it becomes
SMOOTHING = (0.5, -0.53) * 3  # Taubin, "A signal processing approach to fair surface design", 1995
KEPT = 0.1  # of the largest piece's triangles: smaller pieces are crumbs


def surface_of(points: F8) -> tuple[F8, I8]:
    """A closed surface through points (N, 3) that lie densely on an object: vertices (V, 3), triangles (T, 3).

    What the points enclose, gaps of up to three cells of a grid of 44 along the longest side included, is filled, and
    its skin drawn back to the points; a single sheet of points becomes a thin wall.

    Raises:
        ValueError: fewer than 100 points, or all in one place.
    """
    if len(points) < LEAST_POINTS or not np.ptp(points, axis=0).max() > 0:
        raise ValueError(f"{len(points)} points do not make a surface, {LEAST_POINTS} in different places may")
    points = _without_noise(points[:: -(-len(points) // MOST_POINTS)])
    cell = float(np.ptp(points, axis=0).max()) / CELLS
    points = _thinned(points, cell / 2)
    tree = KDTree(points)
    spread = tree.query(points, k=min(7, len(points)))[0][:, -1]
    reach = max(REACH * cell, float(np.percentile(spread, 99)))
    vertices, triangles = _skin(tree, reach, cell)
    vertices, triangles = _without_crumbs(vertices, triangles)
    return _drawn_back(vertices, triangles, tree, reach - THIN * cell), triangles


def _without_noise(points: F8) -> F8:
    """Points that have neighbours about as near as most have."""
    far = KDTree(points).query(points, k=NEIGHBOURS + 1)[0][:, -1]
    return points[far <= ISOLATED * np.median(far)]


def _thinned(points: F8, cell: float) -> F8:
    """The mean of the points in each cell of a grid."""
    where = np.floor((points - points.min(axis=0)) / cell).astype(np.int64)
    _, mine, counts = np.unique(where, axis=0, return_inverse=True, return_counts=True)
    sums = [np.bincount(mine.ravel(), points[:, axis]) for axis in range(3)]
    return np.stack(sums, axis=1) / counts[:, None]


def _skin(tree: KDTree, reach: float, cell: float) -> tuple[F8, I8]:
    """The outer surface at this distance from the points."""
    margin = reach + 2 * cell
    low = tree.mins - margin
    shape = np.ceil((tree.maxes + margin - low) / cell).astype(np.int64) + 1
    grid = np.stack(np.meshgrid(*(np.arange(n) for n in shape), indexing="ij"), axis=-1) * cell + low
    distance = tree.query(grid.reshape(-1, 3), distance_upper_bound=reach + 2 * cell)[0].reshape(shape)
    distance = np.minimum(distance, reach + 2 * cell)
    pieces = np.zeros(distance.shape, np.int32)
    label(distance > reach, output=pieces)
    enclosed = (pieces > 0) & (pieces != pieces[0, 0, 0])
    field = gaussian_filter(np.where(enclosed, 0, distance), 0.6)
    vertices, triangles, _, _ = marching_cubes(field, reach, spacing=(cell, cell, cell))
    return vertices.astype(np.float64) + low, triangles.astype(np.int64)


def _without_crumbs(vertices: F8, triangles: I8) -> tuple[F8, I8]:
    piece = connected_components(_joined(vertices, triangles), directed=False)[1][triangles[:, 0]]
    sizes = np.bincount(piece)
    kept = triangles[sizes[piece] >= KEPT * sizes.max()]
    used, renumbered = np.unique(kept, return_inverse=True)
    return vertices[used], renumbered.reshape(kept.shape)


def _joined(vertices: F8, triangles: I8) -> csr_array:
    """Which vertices are joined by an edge, (V, V): how many times."""
    starts, ends = triangles.ravel(), np.roll(triangles, 1, axis=1).ravel()
    edges = np.concatenate((starts, ends)), np.concatenate((ends, starts))
    return coo_array((np.ones(len(edges[0])), edges), shape=(len(vertices),) * 2).tocsr()


def _drawn_back(vertices: F8, triangles: I8, tree: KDTree, most: float) -> F8:
    """Vertices moved inwards by at most `most` to the level of the points below them, then smoothed."""
    corners = vertices[triangles]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])  # as vectors
    belongs = coo_array((np.ones(triangles.size), (triangles.ravel(), np.arange(triangles.size) // 3))).tocsr()
    normals = belongs @ areas
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-30)[:, None]
    outwards = 1 if np.einsum("ti,ti->", areas, corners[:, 0]) > 0 else -1
    nearest = tree.query(vertices, k=8)[1]
    offset = vertices[:, None] - np.asarray(tree.data)[nearest]
    above = outwards * np.einsum("vi,vki->vk", normals, offset).mean(axis=1)
    around = _joined(vertices, triangles)
    shares = 1 / np.maximum(around.sum(axis=1), 1)
    moved = vertices - outwards * np.clip(above, 0, most)[:, None] * normals
    for step in SMOOTHING:
        moved = moved + step * (shares[:, None] * (around @ moved) - moved)
    return moved
