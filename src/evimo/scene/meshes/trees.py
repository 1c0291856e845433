# pyright: basic
"""Bounding volume hierarchies of triangles, compiled: split where the surface area heuristic is least, by bins."""

import numpy as np

from evimo.scene.rays.compiling import jit

LEAF = 8  # triangles at most, where they can be told apart
BINS = 16
_STEP = 2.0  # cost of visiting a node, in tests of a triangle

_CROWD = 300  # triangles around a vertex that are looked at


@jit
def _area(box):
    x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
    return x * y + y * z + z * x


@jit
def _clear(box):
    box[:3], box[3:] = np.inf, -np.inf


@jit
def _widen(box, low, high):
    for axis in range(3):
        box[axis], box[3 + axis] = min(box[axis], low[axis]), max(box[3 + axis], high[axis])


@jit
def _best_cut(counts, bins, sums):
    """Cost and bin of the best cut between bins: counts (BINS,), their boxes (BINS, 6); sums (BINS,) is scratch."""
    box, number = np.empty(6, np.float64), 0
    _clear(box)
    for b in range(BINS - 1, 0, -1):
        _widen(box, bins[b, :3], bins[b, 3:])
        number += counts[b]
        sums[b] = number * _area(box) if number else np.inf
    _clear(box)
    number, least, cut = 0, np.inf, -1
    for b in range(BINS - 1):
        _widen(box, bins[b, :3], bins[b, 3:])
        number += counts[b]
        if number and number * _area(box) + sums[b + 1] < least:
            least, cut = number * _area(box) + sums[b + 1], b
    return least, cut


@jit
def _split(boxes, middles, mine):
    """Axis, bin, lowest middle and bins per unit of length of the best cut of triangles `mine`, and its cost."""
    counts, bins, sums = np.empty(BINS, np.int64), np.empty((BINS, 6), np.float64), np.empty(BINS, np.float64)
    best = (0, -1, 0.0, 0.0, np.inf)
    for axis in range(3):
        low, high = np.inf, -np.inf
        for k in mine:
            low, high = min(low, middles[k, axis]), max(high, middles[k, axis])
        if not high > low:
            continue
        per = BINS / (high - low)
        counts[:] = 0
        for b in range(BINS):
            _clear(bins[b])
        for k in mine:
            b = min(BINS - 1, int((middles[k, axis] - low) * per))
            counts[b] += 1
            _widen(bins[b], boxes[k, :3], boxes[k, 3:])
        cost, cut = _best_cut(counts, bins, sums)
        if cost < best[4]:
            best = (axis, cut, low, per, cost)
    return best


@jit
def _parted(order, first, stop, middles, axis, cut, low, per):
    """Bring triangles of bins up to `cut` to the front of order[first:stop]; returns where the others begin."""
    a, b = first, stop - 1
    while a <= b:
        if min(BINS - 1, int((middles[order[a], axis] - low) * per)) <= cut:
            a += 1
        else:
            order[a], order[b] = order[b], order[a]
            b -= 1
    return a


@jit
def _cut_at(order, first, stop, box, triangles, middles):
    """Part order[first:stop], which fills `box`: where the second half begins, or `stop` for a leaf; and the axis."""
    number = stop - first
    if number == 1:
        return stop, 0
    axis, cut, low, per, cost = _split(triangles, middles, order[first:stop])
    if number <= LEAF and (cut < 0 or cost + _STEP * _area(box) >= number * _area(box)):
        return stop, axis
    if cut < 0:  # all in one place
        return first + number // 2, axis
    return _parted(order, first, stop, middles, axis, cut, low, per), axis


@jit
def grow(triangles):
    """The tree of triangles given by their boxes (T, 6).

    Returns:
        boxes (N, 6) float32; nodes (N, 4) int32: first triangle of `order` and how many (0: not a leaf), the second
        child (the first is the next row) and the axis that parts them, ordered along it; order (T,) of triangles.
        Rows are in depth-first order.
    """
    total = len(triangles)
    middles = 0.5 * (triangles[:, :3].astype(np.float64) + triangles[:, 3:])
    order = np.arange(total)
    boxes, nodes = np.empty((2 * total, 6), np.float32), np.zeros((2 * total, 4), np.int32)
    waiting, depth, made = np.empty((total + 1, 3), np.int64), 1, 0
    waiting[0, 0], waiting[0, 1], waiting[0, 2] = 0, total, -1
    box = np.empty(6, np.float64)
    while depth:
        depth -= 1
        first, stop, parent = waiting[depth]
        if parent >= 0:
            nodes[parent, 2] = made
        _clear(box)
        for k in order[first:stop]:
            _widen(box, triangles[k, :3], triangles[k, 3:])
        boxes[made] = box
        cut_at, axis = _cut_at(order, first, stop, box, triangles, middles)
        if cut_at >= stop:
            nodes[made, 0], nodes[made, 1] = first, stop - first
        else:
            nodes[made, 3] = axis
            waiting[depth, 0], waiting[depth, 1], waiting[depth, 2] = cut_at, stop, made
            waiting[depth + 1, 0], waiting[depth + 1, 1], waiting[depth + 1, 2] = first, cut_at, -1
            depth += 2
        made += 1
    return boxes[:made].copy(), nodes[:made].copy(), order


@jit
def escapes(nodes):
    """Where to go on after each node (8, N), -1 at the end, for rays of each octant: bit a is set where they go down
    along axis a, and then the second child of a node parted along a comes first.
    """
    misses = np.full((8, len(nodes)), -1, np.int32)
    for octant in range(8):
        mine = misses[octant]
        for node in range(len(nodes)):
            if nodes[node, 1] == 0:
                first, second = node + 1, nodes[node, 2]
                if (octant >> nodes[node, 3]) & 1:
                    first, second = second, first
                mine[first], mine[second] = second, mine[node]
    return misses


@jit
def _around(triangles, count):
    """The triangles around each of `count` vertices: those of v are around[starts[v] : starts[v + 1]]."""
    starts = np.zeros(count + 1, np.int64)
    for k in range(len(triangles)):
        for corner in range(3):
            starts[triangles[k, corner] + 1] += 1
    starts = np.cumsum(starts)
    around, filled = np.empty(3 * len(triangles), np.int64), starts[:-1].copy()
    for k in range(len(triangles)):
        for corner in range(3):
            vertex = triangles[k, corner]
            around[filled[vertex]] = k
            filled[vertex] += 1
    return starts, around


@jit
def corner_normals(areas, triangles, count, least_cosine):
    """Unit normals (T, 9) at the corners of triangles: the mean, by area, of those around the vertex that face much
    the same way (cosine at least `least_cosine`), so that creases stay sharp.

    Args:
        areas: (T, 3) as vectors, twice as long, none zero. triangles: (T, 3) vertex indices below `count`.
    """
    lengths = np.sqrt((areas**2).sum(axis=1))
    starts, around = _around(triangles, count)
    normals = np.empty((len(triangles), 9), np.float32)
    for k in range(len(triangles)):
        mine = areas[k] / lengths[k]
        for corner in range(3):
            vertex, mean = triangles[k, corner], areas[k].copy()
            first, stop = starts[vertex], starts[vertex + 1]
            for other in around[first : min(stop, first + _CROWD)]:
                if other != k and (areas[other] * mine).sum() >= least_cosine * lengths[other]:
                    mean += areas[other]
            normals[k, 3 * corner : 3 * corner + 3] = mean / np.sqrt((mean**2).sum())
    return normals
