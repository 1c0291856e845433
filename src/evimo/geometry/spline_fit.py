"""Uniform cubic B-splines: the weights of their controls at a time, and controls fitted by least squares."""

import numpy as np
from numpy.typing import NDArray

F8 = NDArray[np.float64]
I8 = NDArray[np.int64]

SMOOTHING = 1e-2  # of third differences of controls, which also settles those that no sample touches
BLOCK = 48  # controls that are solved for at a time
BAND = 3


def weights_of(since_us: I8, knot_us: int) -> tuple[I8, F8, F8]:
    """Of times since a piece's start: the first of four controls (M,), their weights and rates per knot (M, 4)."""
    place = since_us / knot_us
    # The end of a piece belongs to its last interval, so that no control lies beyond.
    knot = np.maximum(np.ceil(place).astype(np.int64) - 1, 0)
    u = place - knot
    v = 1 - u
    weights = np.stack((v**3, 3 * u**3 - 6 * u**2 + 4, 3 * v**3 - 6 * v**2 + 4, u**3), axis=-1) / 6
    rates = np.stack((-(v**2), 3 * u**2 - 4 * u, 4 * v - 3 * v**2, u**2), axis=-1) / 2
    return knot, weights, rates


def fitted_controls(first: I8, weights: F8, values: F8, counts: I8) -> F8:
    """Return the controls (K, C) that come nearest to values (N, C) at places with these weights (N, 4).

    first: (N,) of each value's four controls. counts: of controls in each piece; pieces know nothing of each other.
    """
    number = int(counts.sum())
    bands = np.zeros((BAND + 1, number))  # bands[d, j] is the normal matrix at (j, j + d)
    for a in range(4):
        for b in range(a, 4):
            bands[b - a] += np.bincount(first + a, weights[:, a] * weights[:, b], number)
    right = np.stack(
        [sum(np.bincount(first + a, weights[:, a] * column, number) for a in range(4)) for column in values.T],
        axis=1,
    )
    last = np.cumsum(counts)
    inside = np.ones(number, np.bool_)  # where a third difference begins
    for back in range(1, 4):
        inside[np.maximum(last - back, 0)] = False
    begin = np.flatnonzero(inside)
    difference = np.array((-1.0, 3, -3, 1))
    for a in range(4):
        for b in range(a, 4):
            bands[b - a] += np.bincount(begin + a, minlength=number) * SMOOTHING * difference[a] * difference[b]
    bands[0] += 1e-9  # a piece of few samples and no third difference
    return _solved(bands, right)


def _solved(bands: F8, right: F8) -> F8:
    """The solution of a symmetric system of half-bandwidth 3, block by block: time and memory grow with its length."""
    number = len(right)
    solved: list[F8] = []
    onward: list[F8] = []  # what three controls of the next block take away
    corner, carried = np.zeros((BAND, BAND)), np.zeros((BAND, BAND))
    for start in range(0, number, BLOCK):
        stop = min(start + BLOCK, number)
        matrix, b = _block(bands, start, stop), right[start:stop].copy()
        if solved:
            width = min(BAND, stop - start)
            matrix[:width, :width] -= (corner.T @ carried)[:width, :width]
            b[:width] -= (corner.T @ solved[-1][-BAND:])[:width]
        corner = _corner(bands, stop)
        reach = np.zeros((stop - start, BAND))
        reach[-BAND:] = corner[-(stop - start) :]
        found = np.linalg.solve(matrix, np.concatenate((b, reach), axis=1)).astype(np.float64, copy=False)
        solved.append(found[:, : right.shape[1]])
        onward.append(found[:, right.shape[1] :])
        carried = onward[-1][-BAND:]
    for k in range(len(solved) - 2, -1, -1):
        after = solved[k + 1][:BAND]
        solved[k] = solved[k] - onward[k][:, : len(after)] @ after
    return np.concatenate(solved)


def _block(bands: F8, start: int, stop: int) -> F8:
    """The square part of the matrix on its diagonal."""
    size = stop - start
    matrix = np.diag(bands[0, start:stop])
    for distance in range(1, min(BAND, size - 1) + 1):
        beside = np.diag(bands[distance, start : stop - distance], distance)
        matrix += beside + beside.T
    return matrix


def _corner(bands: F8, stop: int) -> F8:
    """What joins the last three controls before `stop` (rows) with the three from there (columns)."""
    corner = np.zeros((BAND, BAND))
    for row in range(BAND):
        for column in range(row + 1):
            at, distance = stop - BAND + row, BAND - row + column
            if at >= 0 and stop + column < bands.shape[1]:
                corner[row, column] = bands[distance, at]
    return corner
