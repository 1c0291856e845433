"""Words that a loss of bytes has shifted: where in a block it was, and by how much those after it are shifted.

Whether words lie where they should shows in their kinds: all are known where they do, and about half where they do
not. Of each block only the last ones are looked at, unless those are wrong.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Sense = Callable[[NDArray[Any]], NDArray[np.bool_]]
"""Tells which of some words can be such words."""

LAST = 256  # words of a block that are looked at
SUSPECT, CLEARER = 8, 8  # so many wrong ones are looked into; another place must make so many times fewer


class Loss(NamedTuple):
    """Bytes of a block to leave out, `first` to `last`, not included: words may lie on either side of a loss."""

    first: int
    last: int


def found_loss(raw: memoryview, item: np.dtype[Any], sense: Sense) -> Loss | None:
    """The bytes around the place where words begin to be shifted; None where they do not, as nearly always.

    Damage that shifts nothing makes words wrong in every place.
    """
    size = item.itemsize
    tail = len(raw) // size - LAST
    if tail < 0:
        return None
    if _wrong(raw[tail * size :], item, sense).sum() < SUSPECT:
        return None
    wrong = [_wrong(raw[tail * size + shift :], item, sense).sum() for shift in range(size)]
    best = int(np.argmin(wrong))
    if wrong[best] * CLEARER > wrong[0]:
        return None
    before, after = _wrong(raw, item, sense), _wrong(raw[best:], item, sense)
    count = len(after)
    # Wrong words, were those before number k where they should be and those from it on shifted.
    cost = np.concatenate(([0], np.cumsum(before[:count]))) + after.sum() - np.concatenate(([0], np.cumsum(after)))
    places = np.flatnonzero(cost == cost.min())
    return Loss(int(places[0]) * size, int(places[-1]) * size + best)


def _wrong(raw: memoryview, item: np.dtype[Any], sense: Sense) -> NDArray[np.bool_]:
    return ~sense(np.frombuffer(raw, item, len(raw) // item.itemsize))
