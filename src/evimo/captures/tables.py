"""Poses and markers in text: TUM's eight columns, and CSV with a line of names; a million lines take seconds."""

import csv
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile

F8 = NDArray[np.float64]

CLOCKS = {"t": 1e6, "t_s": 1e6, "t_ms": 1e3, "t_us": 1.0, "t_ns": 1e-3}  # µs in one unit of a column of times
POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
PLACE = ("x", "y", "z")
LINES = 50_000  # at a time
TUM = "lines of `t x y z qx qy qz qw` (TUM), t in seconds"
CSV = f"CSV whose first line names the columns: t (s) or t_us, {','.join(POSE)}, and maybe body and tracked"
MARKER_CSV = "CSV whose first line names the columns: t (s) or t_us, body, marker, x, y, z"


class Rows(NamedTuple):
    """Some lines of a table.

    times_us: (N,) int64. numbers: (N, C), nan where a cell is empty. words: one tuple of N words for each such column.
    """

    times_us: NDArray[np.int64]
    numbers: F8
    words: tuple[tuple[str, ...], ...]


def is_csv(path: Path) -> bool:
    """Whether the first line of a text that is no comment has commas and names in it."""
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        first = next((line for line in file if line.strip() and not line.startswith("#")), "")
    return "," in first and any(letter.isalpha() for letter in first)


def tum_rows(path: Path) -> Iterator[Rows]:
    """A text in TUM's format, some lines at a time; comments begin with #.

    Raises:
        BadFile: a line is not eight numbers.
    """
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        lines = ((number, line.split()) for number, line in enumerate(file, 1) if not line.lstrip().startswith("#"))
        filled = ((number, words) for number, words in lines if words)
        while some := list(islice(filled, LINES)):
            values = _numbers(path, some, range(1 + len(POSE)), TUM)
            yield Rows(_times(path, values[:, 0] * CLOCKS["t"], some), values[:, 1:], ())


def csv_rows(path: Path, numbers: Sequence[str], words: Sequence[str], *, form: str) -> Iterator[Rows]:
    """A CSV, some lines at a time.

    Args:
        path: the file.
        numbers, words: names of columns; those in brackets, as `[body]`, may be missing, and then are nan or empty.
        form: what the file should be, for errors.

    Raises:
        BadFile: a column is missing, or a cell holds no number.
    """
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        reader = csv.reader(file)
        table = _filled(path, reader, form)
        names = [cell.strip().lower() for cell in next((row for _, row in table), [])]
        clock = next((name for name in CLOCKS if name in names), None)
        if clock is None:
            raise BadFile(f"{path}, line {reader.line_num}: no column of times", fix=form)
        columns = [names.index(clock), *(_column(path, names, name, form) for name in numbers)]
        texts = [_column(path, names, name, form) for name in words]
        while some := list(islice(table, LINES)):
            values = _numbers(path, some, columns, form)
            named = (tuple(row[at].strip() if 0 <= at < len(row) else "" for _, row in some) for at in texts)
            yield Rows(_times(path, values[:, 0] * CLOCKS[clock], some), values[:, 1:], tuple(named))


def _filled(path: Path, reader: Any, form: str) -> Iterator[tuple[int, list[str]]]:
    """Rows that hold something and are no comments, with their lines."""
    try:
        for row in reader:
            if row and not row[0].startswith("#") and any(cell.strip() for cell in row):
                yield reader.line_num, row
    except csv.Error as error:
        raise BadFile(f"{path}, line {reader.line_num}: {error}", fix=form) from error


def _column(path: Path, names: list[str], name: str, form: str) -> int:
    """The place of a column; -1 of one in brackets that is missing."""
    plain = name.strip("[]")
    if plain not in names and name == plain:
        raise BadFile(f"{path} has no column {name!r}, only {', '.join(names)[:200]}", fix=form)
    return names.index(plain) if plain in names else -1


def _numbers(path: Path, rows: Sequence[tuple[int, list[str]]], columns: Sequence[int], form: str) -> F8:
    """Numbers (N, C) of some columns of some lines."""
    try:
        return np.array([[_number(row, at) for at in columns] for _, row in rows], np.float64)
    except (ValueError, IndexError):
        for line, row in rows:
            _check(path, line, row, columns, form)
        raise


def _number(row: list[str], at: int) -> float:
    if at < 0:
        return np.nan
    cell = row[at]
    return float(cell) if cell and not cell.isspace() else np.nan


def _check(path: Path, line: int, row: list[str], columns: Sequence[int], form: str) -> None:
    """Name the line that holds no numbers where they should be."""
    try:
        for at in columns:
            _number(row, at)
    except (ValueError, IndexError) as error:
        shown = " ".join(row)[:60]
        raise BadFile(f"{path}, line {line}: {shown!r} does not hold {len(columns)} numbers", fix=form) from error


def _times(path: Path, times_us: F8, rows: Sequence[tuple[int, list[str]]]) -> NDArray[np.int64]:
    bad = ~(np.abs(times_us) < 2**62)  # nan too
    if bad.any():
        raise BadFile(
            f"{path}, line {rows[int(bad.argmax())][0]}: not a time", fix="a number of seconds, or µs in t_us"
        )
    return np.rint(times_us).astype(np.int64)
