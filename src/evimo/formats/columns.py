"""The order of a table's columns: as the user says it, by their names, or from what they hold."""

import re
from collections.abc import Sequence
from itertools import permutations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, BadInput

LETTERS = "txyp"
NAMES = {
    "t": {"t", "ts", "time", "timestamp", "timestamps", "t_us", "time_us", "timestamp_us"},
    "x": {"x", "xs", "col", "column"},
    "y": {"y", "ys", "row"},
    "p": {"p", "ps", "pol", "polarity", "polarities", "on"},
}
MOST_COLUMNS = 12
LARGEST_PIXEL = 16384  # beyond every sensor
FEW_ROWS = 10  # fewer say nothing of what rises
FIX = "name the columns in their order with --columns, a letter each, as in txyp or xytp; _ for one to leave out"


def said_columns(columns: str) -> str:
    """Return the letters of `--columns`, checked: t, x, y and p once each, any others as _.

    Raises:
        BadInput: a letter is missing, there twice, or unknown.
    """
    letters = columns.strip().lower().replace(",", "").replace(" ", "")
    if sorted(letters.replace("_", "")) != sorted(LETTERS):
        raise BadInput(f"--columns {columns!r} does not name t, x, y and p once each", fix=FIX)
    return letters


def named_columns(words: Sequence[str]) -> str | None:
    """Return the letters of columns by the words of a heading, _ for others; None if it does not name all four."""
    letters = ""
    for word in words:
        name = re.sub(r"[\[(@].*", "", word.strip("\"'").lower()).strip()
        found = next((letter for letter, names in NAMES.items() if name in names), "_")
        letters += "_" if found in letters else found
    return letters if set(LETTERS) <= set(letters) else None


def found_columns(path: Path, sample: NDArray[np.float64]) -> str:
    """Return the letters of columns from what they hold: rows (N, C) of all parts of the file, in its
    order.

    Polarities are 0 and 1, or -1 and 1; pixels are below 16384, whole if they can be, columns before rows; times are
    what pixels cannot be, or do not fall. A first column that counts the rows is left out. Where the usual order
    t x y p is as good as any other, it is taken.

    Raises:
        BadFile: no order fits, or several do.
    """
    if not len(LETTERS) <= sample.shape[1] <= MOST_COLUMNS:
        raise BadFile(
            f"{path.name} is no event recording: its lines have {sample.shape[1]} columns",
            fix="events as text have a line each, with t, x, y and p",
        )
    first = 1 if sample.shape[1] > 4 and len(sample) > 2 and _mostly(np.diff(sample[:, 0]) == 1) else 0
    ranked = _ranked(sample, [first + at for at in range(4)]) or _ranked(sample, range(sample.shape[1]))
    if not ranked:
        shown = " ".join(f"{value:.12g}" for value in sample[0])
        raise BadFile(f"{path.name} is no event recording: in {shown!r} no order of t, x, y and p makes sense", fix=FIX)
    best, order = ranked[0]
    if len(ranked) > 1 and ranked[1][0] == best:
        raise BadFile(f"{path.name}: its columns may be {order} or {ranked[1][1]}, nothing tells", fix=FIX)
    return order


def _ranked(sample: NDArray[np.float64], columns: Sequence[int]) -> list[tuple[tuple[bool, ...], str]]:
    """The orders that make sense, the best first."""
    facts = {column: _Column(sample[:, column]) for column in columns}
    found: list[tuple[tuple[bool, ...], str]] = []
    for t, x, y, p in permutations(columns, 4):
        if x > y or not (facts[p].is_polarity and facts[x].is_pixel and facts[y].is_pixel):
            continue
        letters = "".join({t: "t", x: "x", y: "y", p: "p"}.get(column, "_") for column in range(sample.shape[1]))
        found.append((_merits(facts, t, x, y) + (letters.replace("_", "") == LETTERS,), letters))
    return sorted(found, reverse=True)


def _merits(facts: dict[int, "_Column"], t: int, x: int, y: int) -> tuple[bool, ...]:
    whole = facts[x].is_whole and facts[y].is_whole
    return whole, not facts[t].is_pixel, facts[t].rises and not (facts[x].rises and facts[y].rises), facts[t].rises


class _Column:
    """What the values of a column may be."""

    def __init__(self, values: NDArray[np.float64]) -> None:
        finite = values[np.isfinite(values)]
        self.is_polarity = _mostly(np.isin(finite, (-1, 0, 1)))
        self.is_pixel = _mostly((finite > -LARGEST_PIXEL) & (finite < LARGEST_PIXEL))
        self.is_whole = _mostly(finite == np.rint(finite))
        self.rises = bool(len(finite) >= FEW_ROWS and finite[-1] > finite[0] and (np.diff(finite) >= 0).mean() > 0.9)


def _mostly(right: NDArray[np.bool_]) -> bool:
    """Whether something holds but for a few damaged lines."""
    wrong = len(right) - int(right.sum())
    return wrong <= len(right) // 5 or (wrong == 1 and len(right) > 2) if len(right) else False
