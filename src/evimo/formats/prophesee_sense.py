"""Which words of Prophesee's encodings can be such: of a known kind, and with a clock that goes on steadily."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.formats.prophesee_header import KINDS, LONGEST_STEP, TIME_HIGH


def evt2_sense(words: NDArray[Any]) -> NDArray[np.bool_]:
    """Of EVT 2.0 words (u4)."""
    return _known("EVT2", words >> 28) & _steady(words >> 28, words & 0xFFFFFFF, bits=28)


def evt21_sense(halves: NDArray[Any], head: int) -> NDArray[np.bool_]:
    """Of EVT 2.1 words, (N, 2) u4, half number `head` of which tells the kind; events are of at least one pixel."""
    kinds, pixels = halves[:, head] >> 28, halves[:, 1 - head]
    return evt2_sense(halves[:, head]) & ((kinds > 1) | (pixels != 0))


def evt3_sense(words: NDArray[Any]) -> NDArray[np.bool_]:
    """Of EVT 3.0 words (u2)."""
    return _known("EVT3", words >> 12) & _steady(words >> 12, words & 0xFFF, bits=12)


def _known(name: str, kinds: NDArray[Any]) -> NDArray[np.bool_]:
    table = np.zeros(16, np.bool_)
    table[list(KINDS[name])] = True
    return table[kinds]


def _steady(kinds: NDArray[Any], clocks: NDArray[Any], *, bits: int) -> NDArray[np.bool_]:
    """All words but those whose clock is far from the one before it."""
    steady = np.ones(len(kinds), np.bool_)
    places = np.flatnonzero(kinds == TIME_HIGH)
    steps = np.diff(clocks[places].astype(np.int64)) & ((1 << bits) - 1)
    steady[places[1:]] = steps <= LONGEST_STEP[bits]
    return steady
