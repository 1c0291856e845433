"""The order of a table's columns: as the user says it, by their names, or from what they hold."""

import re
import warnings
from collections.abc import Sequence
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, BadInput, EvimoWarning
from evimo.formats.time_units import TimeUnit

LETTERS = "txyp"
NAMES = {
    "t": {"t", "ts", "time", "times", "timestamp", "timestamps"},
    "x": {"x", "xs", "col", "column", "posx", "xpos"},
    "y": {"y", "ys", "row", "posy", "ypos"},
    "p": {"p", "ps", "pol", "polarity", "polarities", "on"},
}
ALSO = {"u": "x", "v": "y"}  # where no other name says x and y: beside them u and v are a flow
SECONDS = {"sec", "secs", "seconds"}
PARTS = {"nsec", "nsecs", "nanosec", "nanosecs", "nanoseconds", "usec", "usecs", "microseconds"}  # of a second
CAMERAS = {"cam", "camera", "camid", "cameraid", "cameraindex", "camindex", "camnumber", "device", "deviceid"}
BESIDE = {"event", "events", "ev", "pixel", "px", "pos", "position", "coord", "coordinate", "addr", "address", "sensor"}
UNITS: dict[str, TimeUnit] = {
    **dict.fromkeys(("s", "sec", "secs", "seconds"), "s"),
    **dict.fromkeys(("ms", "msec", "msecs", "millis", "milliseconds"), "ms"),
    **dict.fromkeys(("us", "µs", "μs", "\ufffds", "usec", "usecs", "micros", "microseconds"), "us"),
    **dict.fromkeys(("ns", "nsec", "nsecs", "nanos", "nanoseconds"), "ns"),
}
UNIT = re.compile(rf"[_\s\[(]+({'|'.join(UNITS)})[\])]?$")  # as in t_us, time [ms] and timestamp(ns)
MOST_COLUMNS = 12
UNIX_S = 10**8  # seconds since 1970 are more
LARGEST_PIXEL = 16384  # beyond every sensor
FEW_ROWS = 10  # fewer say nothing of what rises
FIX = "name the columns in their order with --columns, a letter each, as in txyp or xytp; _ for one to leave out"


def said_columns(columns: str) -> str:
    """Return the letters of `--columns`, checked: t, x, y and p once each, any others as _.

    Raises:
        BadInput: a letter is missing, there twice, or unknown.
    """
    letters = str(columns).lower().replace(",", "").replace(" ", "")
    if sorted(letters.replace("_", "")) != sorted(LETTERS):
        raise BadInput(f"--columns {columns!r} does not name t, x, y and p once each", fix=FIX)
    return letters


def sized_columns(columns: str, width: int) -> str:
    """Return the letters of `--columns` for so many columns, _ for those that are not said.

    Raises:
        BadInput: as `said_columns`, or there are fewer columns.
    """
    letters = said_columns(columns).ljust(width, "_")
    if len(letters) > width:
        raise BadInput(f"--columns {columns!r} names {len(letters)} columns, and there are {width}", fix=FIX)
    return letters


def named_columns(words: Sequence[str]) -> str | None:
    """Return the letters of columns by the words of a heading, _ for others; None if it does not name all four."""
    letters = ""
    for word in words:
        found = next((each for each, names in NAMES.items() if _core(word, each) in names), "_")
        letters += "_" if found in letters else found
    if not {"x", "y"} & set(letters):
        others = [ALSO.get(_core(word, "x"), "_") for word in words]
        letters = "".join(other if each == "_" else each for each, other in zip(letters, others, strict=True))
    return letters if sorted(letters.replace("_", "")) == sorted(LETTERS) else None


def _core(word: str, letter: str) -> str:
    """The part of a column's name that tells: x of x_coordinate and of x@346, t of t_us."""
    plain = word.strip("\"'").lower()
    name = UNIT.sub("", plain).strip() if letter == "t" else re.sub(r"[\[(@].*", "", plain).strip()
    return "_".join(word for word in re.split(r"[\s_.-]+", name) if word not in BESIDE)


def named_unit(words: Sequence[str], columns: str) -> TimeUnit | None:
    """Return the unit that the heading of the time's column tells, as in t_us or `time [ms]`; None where it does not.

    `columns` are the letters of the words.
    """
    match = UNIT.search(words[columns.index("t")].strip("\"'").lower())
    return UNITS[match[1]] if match else None


def refuse_split_times(path: Path, sample: NDArray[np.float64], columns: str) -> None:
    """Refuse times in two columns, seconds and what is left of them: alone, the second starts anew each second.

    Raises:
        BadFile: the column before the times does not fall, and rises where they start anew, or is a date.
    """
    at = columns.index("t") - 1
    if at < 0 or columns[at] != "_" or len(sample) < 2:
        return
    seconds, rest = sample[:, at], sample[:, at + 1]
    rises, anew = np.diff(seconds), np.diff(rest) < 0
    if not np.isfinite(seconds).all() or (rises < 0).any() or (seconds != np.rint(seconds)).any():
        return
    carried = anew.any() and bool((rises[anew] > 0).all()) and 2 * np.count_nonzero(rises) < len(rises)
    if carried or (seconds[0] > UNIX_S and not rises.any()):
        raise BadFile(
            f"{path.name} has its times in two columns, seconds and what is left of them, as in "
            f"{' '.join(f'{value:.12g}' for value in sample[0])!r}",
            fix="write them as one number, such as seconds with their decimals; or choose one with --columns",
        )


def refuse_named_parts(path: Path, words: Sequence[str], sample: NDArray[np.float64]) -> None:
    """Refuse a table whose heading names times in two columns, or several cameras, whose events nothing would part.

    `words` are those of the heading; what lies below them tells nothing where they are not as many.

    Raises:
        BadFile: it is such a table.
    """
    named = [re.split(r"[\s_.]+", word.lower()) for word in words]
    seconds, parts = ({tuple(rest) for *rest, unit in named if unit in units} for units in (SECONDS, PARTS))
    if seconds & parts:  # as in t_sec and t_nsec
        raise BadFile(
            f"{path.name} has its times in two columns, as its heading {' '.join(words)!r} says",
            fix="write them as one number, such as seconds with their decimals; or choose one with --columns",
        )
    for at, word in enumerate(words if len(words) == sample.shape[1] else ()):
        if re.sub(r"[\s_.]+", "", word.lower()) in CAMERAS and len(np.unique(sample[:, at])) > 1:
            raise BadFile(
                f"{path.name} holds events of several cameras, told apart by its column {word!r}",
                fix="write those of one camera into a file of their own; or give their order with --columns",
            )


def found_columns(path: Path, sample: NDArray[np.float64], shown: str = "") -> str:
    """Return the letters of columns from what they hold: rows (N, C) of all parts of the file, in its order.

    Polarities are 0 and 1, or -1 and 1; pixels are below 16384, whole if they can be, columns before rows; both go up
    and down if any such do, but for polarities in the usual order t x y p; times are what pixels cannot be, or do not
    fall. A first column that counts the rows is left out; of more than four the first four go before others. Where the
    usual order is as good as any other, it is taken. `shown` is a row as the file has it, for messages.

    Raises:
        BadFile: no order fits, or several do.
    """
    if not len(LETTERS) <= sample.shape[1] <= MOST_COLUMNS:
        raise BadFile(
            f"{path.name} is no event recording: its lines have {sample.shape[1]} columns",
            fix="events as text have a line each, with t, x, y and p",
        )
    first = 1 if sample.shape[1] > 4 and len(sample) > 2 and _mostly(np.diff(sample[:, 0]) == 1) else 0
    ranked = _ranked(sample, range(first, first + 4))
    if not ranked:
        shown = shown or " ".join(f"{value:.12g}" for value in sample[0])
        raise BadFile(f"{path.name} is no event recording: in {shown!r} no order of t, x, y and p makes sense", fix=FIX)
    best, order = ranked[0]
    if len(ranked) > 1 and ranked[1][0] == best:
        for _, letters in ranked[:2]:
            refuse_split_times(path, sample, letters)
        raise BadFile(f"{path.name}: its columns may be {order} or {ranked[1][1]}, nothing tells", fix=FIX)
    refuse_split_times(path, sample, order)
    return order


def signs(polarities: NDArray[Any]) -> NDArray[np.int8]:
    """Return polarities as +1 and -1: what is above 0 is brighter."""
    on = np.asarray(polarities > 0).view(np.int8)
    return on * np.int8(2) - np.int8(1)  # of polarities without order three times as fast as a choice for each


def check_polarities(path: Path, sample: NDArray[Any]) -> None:
    """Refuse polarities that are counted otherwise, such as 1 and 2: all would be brighter.

    Raises:
        BadFile: there are several, and none is 0 or less.
    """
    values = np.unique(sample[sample == sample])
    if len(values) > 1 and values[0] > 0:
        shown = " and ".join(f"{value:g}" for value in values[:2].tolist())
        raise BadFile(
            f"{path.name}: its polarities are {shown}, and nothing tells which is brighter",
            fix="write 1 for brighter, and 0 or -1 for darker; EVIMO2 of before 24 May 2022: download it again",
        )


def check_pixels(path: Path, x: NDArray[Any], y: NDArray[Any]) -> None:
    """Say of arrays that events which lie between pixels are rounded.

    Raises:
        BadFile: as `refuse_normalised`.
    """
    if any(np.any(side != np.rint(side)) for side in refuse_normalised(path, x, y)):
        text = f"{path.name}: its events lie between pixels and are rounded to the nearest"
        warnings.warn(text, EvimoWarning, stacklevel=4)


def refuse_normalised(path: Path, x: NDArray[Any], y: NDArray[Any]) -> list[NDArray[Any]]:
    """Refuse coordinates from 0 to 1, or -1 to 1, that are parts of an image; else return those that are numbers.

    Raises:
        BadFile: all are so, and they have fractions.
    """
    sides = [np.asarray(side[np.isfinite(side)], np.float64) for side in (x, y)]
    if all(len(side) and np.abs(side).max() <= 1 and np.any(side != np.rint(side)) for side in sides):
        raise BadFile(
            f"{path.name}: its pixels, such as {sides[0][0]:.4g}, {sides[1][0]:.4g}, are parts of an image",
            fix="multiply them with the sensor's width and height: whole columns and rows are read",
        )
    return sides


def check_lengths(path: Path, lengths: dict[str, int]) -> None:
    """Refuse columns that hold unequal numbers of values: nothing tells which of them belong together.

    Args:
        path: of the recording. lengths: what each column was written with, by the name of its array.

    Raises:
        BadFile: they differ.
    """
    if len(set(lengths.values())) > 1:
        shown = ", ".join(f"{name} {length:,}" for name, length in lengths.items())
        text = f"{path}: arrays of unequal length ({shown}), so that nothing tells which values are of one event"
        raise BadFile(text, fix="copy all of them again from one recording, or export it again")


def _ranked(sample: NDArray[np.float64], usual: range) -> list[tuple[tuple[bool, ...], str]]:
    """The orders that make sense, the best first; those of the usual columns go before others."""
    facts = {column: _Column(sample[:, column]) for column in range(sample.shape[1])}
    found: list[tuple[tuple[bool, ...], str]] = []
    for t, x, y, p in permutations(facts, 4):
        if x > y or not (facts[p].is_polarity and facts[x].is_pixel and facts[y].is_pixel):
            continue
        letters = "".join({t: "t", x: "x", y: "y", p: "p"}.get(column, "_") for column in range(sample.shape[1]))
        is_usual = {t, x, y, p} == set(usual)
        in_order = is_usual and letters.strip("_") == LETTERS  # whose polarities may all be 1, before a label
        outer = in_order or facts[p].turns, facts[x].turns and facts[y].turns, is_usual
        found.append((outer + _merits(facts, t, x, y) + (letters.replace("_", "") == LETTERS,), letters))
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
        steps = np.diff(finite)  # of a camera's number or of whole seconds, they are 0 or of one sign
        self.turns = bool(len(finite) >= FEW_ROWS and (steps > 0).any() and (steps < 0).any())


def _mostly(right: NDArray[np.bool_]) -> bool:
    """Whether something holds but for a few damaged lines."""
    wrong = len(right) - int(right.sum())
    return wrong <= len(right) // 5 or (wrong == 1 and len(right) > 2) if len(right) else False
