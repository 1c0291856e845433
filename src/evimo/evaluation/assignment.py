"""Which of many goes with which, so that the sum of all is largest (Kuhn 1955, Munkres 1957).

SciPy has it, too, but comes with the extra `[simulate]` only; a test holds both equal.
"""

import numpy as np
from numpy.typing import NDArray


def best_assignment(gain: NDArray[np.float64]) -> NDArray[np.int64]:
    """The row (T,) that each column of `gain` (P, T) gets, no row twice, so that the sum is largest; -1 for none.

    Gains must not be negative. Shortest augmenting paths with potentials: T steps of at most T searches through P rows.
    """
    count, rows = gain.shape[1], gain.shape[0]
    cost = -np.pad(gain, ((0, count), (0, 0)))  # as many rows more that are worth nothing
    of_column, of_row = np.zeros(count), np.zeros(len(cost))  # potentials
    owner = np.full(len(cost), -1)  # the column that has each row
    for start in range(count):
        _augment(cost, (of_column, of_row), owner, start)
    found = np.full(count, -1)
    taken = np.flatnonzero(owner >= 0)
    found[owner[taken]] = np.where(taken < rows, taken, -1)
    return found


def _augment(
    cost: NDArray[np.float64],
    potentials: tuple[NDArray[np.float64], NDArray[np.float64]],
    owner: NDArray[np.int64],
    start: int,
) -> None:
    """Give the column `start` a row, along the cheapest path of changes to those that have one."""
    of_column, of_row = potentials
    least, before = np.full(len(cost), np.inf), np.full(len(cost), -1)
    reached = np.zeros(len(cost), np.bool_)
    column, row = start, -1
    while True:
        reduced = cost[:, column] - of_column[column] - of_row
        nearer = ~reached & (reduced < least)
        least[nearer], before[nearer] = reduced[nearer], row
        row = int(np.argmin(np.where(reached, np.inf, least)))
        step = least[row]
        of_column[[start, *owner[reached]]] += step
        of_row[reached] -= step
        least[~reached] -= step
        reached[row] = True
        if owner[row] < 0:
            break
        column = int(owner[row])
    while row >= 0:
        last = int(before[row])
        owner[row] = start if last < 0 else owner[last]
        row = last
