"""Files with a label for each event, as blocks of rows in constant memory: CSV, npz, and our own `events.h5`."""

import csv
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import IO, Any

import h5py
import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile
from evimo.formats.array_rows import Rows
from evimo.formats.npz_members import Archive
from evimo.predictions.runs import facts_of, opened_h5, sound

BLOCK = 65_536  # events
NAMES = (
    ("t_us", "t", "ts", "time", "timestamp", "times"),
    ("x", "col", "column"),
    ("y", "row"),
    ("label", "labels", "object", "objects", "cluster"),
)
T, X, Y, LABEL = range(4)
FIX = "one row for each event with columns t, x, y and label, or label alone for every event of the recording in order"

Block = NDArray[np.int64]
"""(N, 4): time in µs, column, row, label; only labels where events are told apart by nothing but their order."""


@dataclass(frozen=True, slots=True)
class LabelFile:
    """A file of labels.

    located: whether each row tells time and place of its event, else it is the next event of the recording.
    total:   rows, where that is known without reading them.
    """

    path: Path
    kind: str
    located: bool
    total: int | None
    blocks: Callable[[], Iterator[Block]]
    facts: dict[str, str]


def in_microseconds(times: NDArray[Any], name: str, path: Path) -> NDArray[np.int64]:
    """Times as whole µs: whole numbers are µs, as is anything called `…_us`; fractions are seconds."""
    if not np.isfinite(times).all():
        raise BadFile(f"{path} has times that are no numbers", fix=FIX)
    in_seconds = times.dtype.kind == "f" and not name.endswith("_us")
    return np.rint(times * 1e6 if in_seconds else times).astype(np.int64)


def labels_in_npz(archive: Archive) -> LabelFile:
    """The arrays `labels` (N,), and where they are there `t`, `x`, `y` beside it.

    Raises:
        BadFile: there are none, or they do not fit together.
    """
    path = archive.path
    names = [next((name for name in known if name in archive.names), None) for known in NAMES]
    if names[LABEL] is None:
        raise BadFile(f"{path} has neither masks, nor ids, nor labels: {', '.join(sorted(archive.names))}", fix=FIX)
    located = None not in names
    chosen = [name for name in (names if located else names[LABEL:]) if name is not None]
    columns = [Rows(archive, name, dimensions=1, kinds="biuf", fix=FIX) for name in chosen]
    if len({len(column) for column in columns}) > 1:
        raise BadFile(f"{', '.join(chosen)} of {path} have not one length", fix=FIX)

    def blocks() -> Iterator[Block]:
        for first in range(0, len(columns[0]), BLOCK):
            last = min(first + BLOCK, len(columns[0]))
            yield _block([column.read(first, last) for column in columns], chosen[0], path)

    return LabelFile(path, "npz, labels of events", located, len(columns[0]), blocks, {})


def labels_in_h5(path: Path) -> LabelFile:
    """Our own `events.h5`.

    Raises:
        BadFile: damaged, or without a column.
    """
    file = opened_h5(path)
    stored: Any = file
    names = ("t_us", "x", "y", "object")
    with sound(path):
        whole = all(isinstance(stored.get(name), h5py.Dataset) for name in names)
        fitting = whole and len({stored[name].shape for name in names}) == 1 and stored["x"].ndim == 1
        fitting = fitting and all(stored[name].dtype.kind in "iu" for name in names)
    if not fitting:
        raise BadFile(f"{path} holds no labelled events", fix="evimo run RECORDING --event-labels")

    def blocks() -> Iterator[Block]:
        for first in range(0, len(stored["t_us"]), BLOCK):
            with sound(path):
                columns = [np.asarray(stored[name][first : first + BLOCK]) for name in names]
            yield _block(columns, names[0], path)

    return LabelFile(path, "events.h5", True, len(stored["t_us"]), blocks, facts_of(file))


def labels_in_csv(path: Path) -> LabelFile:
    """Lines of numbers: a label each, or under a heading that names t, x, y and label in any order.

    Raises:
        BadFile: there are no such lines.
    """
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        first = file.readline().strip().lower().lstrip("#% ")
        sample = [first, *(line.strip() for line in islice(file, 100))]
    mark = next((mark for mark in ",;\t " if mark in first), ",")
    words = [word.strip().strip('"') for word in next(csv.reader([first], delimiter=mark), [])]
    headed = not all(_is_number(word) for word in words)
    found = [next((words.index(name) for name in known if name in words), None) for known in NAMES]
    if (headed and found[LABEL] is None) or (not headed and len(words) != 1):
        raise BadFile(f"{path} holds no labels of events: its first line is {first[:60]!r}", fix=FIX)
    located = headed and None not in found
    order = [at for at in (found if located else found[LABEL:] if headed else [0]) if at is not None]
    name = words[order[0]] if headed else "label"
    cells = [line.split(mark)[order[0]] for line in sample[headed:] if len(line.split(mark)) > order[0]]
    if located and not any(sign in cell for cell in cells for sign in ".e"):
        name = "t_us"  # whole numbers

    def blocks() -> Iterator[Block]:
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            next(islice(file, int(headed), int(headed)), None)
            while len(rows := _lines(file, mark, order, path)):
                yield _block(list(rows.T), name, path)

    return LabelFile(path, "CSV, labels of events", located, None, blocks, {})


def _lines(file: IO[str], mark: str, order: list[int], path: Path) -> NDArray[np.float64]:
    """The next block of lines as numbers; none at the end."""
    lines = list(islice(file, BLOCK))
    if not lines:
        return np.zeros((0, len(order)))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of empty lines at the end
            return np.loadtxt(lines, delimiter=None if mark == " " else mark, usecols=order, ndmin=2)
    except ValueError as error:
        raise BadFile(f"{path} has a line that is no label: {error}", fix=FIX) from error


def _block(columns: list[NDArray[Any]], time: str, path: Path) -> Block:
    """Columns as one block; labels below 0, which clustering calls noise, become 0."""
    label = columns[-1]
    for values in columns[-3:]:  # not the times
        if not (np.isfinite(values) & (values == np.rint(values))).all():
            raise BadFile(f"{path} has labels or pixels that are no whole numbers", fix=FIX)
    block = np.zeros((len(label), 4), np.int64)
    block[:, LABEL] = np.maximum(label.astype(np.int64), 0)
    if len(columns) == 4:
        block[:, T] = in_microseconds(columns[T], time, path)
        block[:, X], block[:, Y] = columns[X], columns[Y]
    return block


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
