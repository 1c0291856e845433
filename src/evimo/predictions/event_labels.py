"""Labels of events found again: by their place in the recording, or by time and pixel."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, BadInput
from evimo.events.events import Events
from evimo.events.slices import Slice
from evimo.formats.event_file import EventFile
from evimo.predictions.label_files import FIX, LABEL, Block, LabelFile, T, X, Y
from evimo.predictions.sources import Labels


def found_labels(file: LabelFile, events: EventFile, count: int) -> Labels:
    """The labels of a file for the events of a recording, of which `count` are stored.

    Raises:
        BadInput: labels without places are not as many as the events.
    """
    if file.located:
        return _ByPlace(file, events.sensor)
    if file.total is not None and file.total != count:
        raise BadInput(f"{file.path} has {file.total:,} labels, the recording {count:,} events", fix=FIX)
    return _InOrder(file, events)


class _Waiting:
    """Rows of a file, taken from the front."""

    def __init__(self, blocks: Iterator[Block], path: Path) -> None:
        self._blocks, self._path = blocks, path
        self._rows = np.zeros((0, 4), np.int64)
        self._over = False

    def first(self, count: int) -> Block:
        """So many rows, fewer only at the end."""
        while len(self._rows) < count and self._more():
            pass
        return self._taken(count)

    def before(self, stop_us: int) -> Block:
        """All rows of before that time."""
        while (not len(self._rows) or self._rows[-1, T] < stop_us) and self._more():
            pass
        return self._taken(int(np.searchsorted(self._rows[:, T], stop_us)))

    def _taken(self, count: int) -> Block:
        rows, self._rows = self._rows[:count], self._rows[count:]
        return rows

    def _more(self) -> bool:
        block = None if self._over else next(self._blocks, None)
        if block is None:
            self._over = True
            return False
        last_us = self._rows[-1:, T]
        if (np.diff(block[:, T], prepend=last_us) < 0).any():
            raise BadFile(f"times of labels in {self._path} go back", fix="sort the rows by time")
        self._rows = np.concatenate((self._rows, block))
        return True


class _InOrder:
    """Row k is of event k of the recording."""

    def __init__(self, file: LabelFile, events: EventFile) -> None:
        self.unlabelled = 0
        self._path, self._events = file.path, events
        self._waiting = _Waiting(file.blocks(), file.path)

    def of(self, part: Slice) -> NDArray[np.int64] | None:
        """The next labels, as many as the slice has events."""
        faults = self._events.faults
        if faults.out_of_order or faults.dropped:
            raise BadInput(
                f"events of {self._events.path} had to be sorted or dropped: {self._path} cannot tell which labels are"
                " theirs by order alone",
                fix="add columns t, x and y to the labels",
            )
        rows = self._waiting.first(len(part.events))
        if len(rows) < len(part.events):
            raise BadInput(f"{self._path} has fewer labels than the recording has events", fix=FIX)
        return rows[:, LABEL]

    def finish(self) -> None:
        """Refuse what is left."""
        if len(self._waiting.first(1)):
            raise BadInput(f"{self._path} has more labels than the recording has events", fix=FIX)


class _ByPlace:
    """Each row tells time and pixel of its event; equal ones are taken in their order."""

    def __init__(self, file: LabelFile, sensor: tuple[int, int]) -> None:
        self.unlabelled = 0
        self._path, self._sensor = file.path, sensor
        self._waiting = _Waiting(file.blocks(), file.path)

    def of(self, part: Slice) -> NDArray[np.int64] | None:
        """The labels of a slice's events; events without one are counted, labels without an event refused."""
        rows = self._waiting.before(part.stop_us)
        self._check_inside(rows)
        if not len(rows) and len(part.events):
            return None
        wanted, had = _told_apart(self._places(rows), self._places(_rows_of(part.events)))
        order = np.argsort(had)
        at = np.searchsorted(had[order], wanted)
        found = np.isin(wanted, had)
        if not found.all():
            t, x, y, _ = rows[int(np.argmin(found))].tolist()
            raise BadInput(
                f"{self._path} labels an event at {t} µs, column {x}, row {y}, that the recording does not have;"
                f" {np.count_nonzero(~found):,} of {len(rows):,} of that slice",
                fix="labels of this very recording; times in whole µs, or in seconds with six digits after the point",
            )
        labels = np.zeros(len(part.events), np.int64)
        labels[order[at]] = rows[:, LABEL]
        self.unlabelled += len(part.events) - len(rows)
        return labels

    def finish(self) -> None:
        """Refuse what is left."""
        if len(rows := self._waiting.first(1)):
            raise BadInput(f"{self._path} labels events at {rows[0, T]} µs, after the recording's end", fix=FIX)

    def _check_inside(self, rows: Block) -> None:
        height, width = self._sensor
        outside = (rows[:, X] < 0) | (rows[:, X] >= width) | (rows[:, Y] < 0) | (rows[:, Y] >= height)
        if outside.any():
            _, x, y, _ = rows[int(np.argmax(outside))].tolist()
            raise BadInput(
                f"{self._path} labels an event at column {x}, row {y}; the sensor has {width} x {height} pixels",
                fix="labels of this very recording, in sensor pixels",
            )

    def _places(self, rows: Block) -> NDArray[np.int64]:
        height, width = self._sensor
        return (rows[:, T] * height + rows[:, Y]) * width + rows[:, X]


def _rows_of(events: Events) -> Block:
    return np.stack((events.t, events.x, events.y, np.zeros(len(events))), axis=1).astype(np.int64)


def _told_apart(wanted: NDArray[np.int64], had: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Numbers in place of places, different for the first, second, … of the same place, the same in both."""
    _, index = np.unique(np.concatenate((wanted, had)), return_inverse=True)
    parts = index[: len(wanted)], index[len(wanted) :]
    ranks = [_rank_among_equals(part) for part in parts]
    most = max((int(rank.max(initial=0)) for rank in ranks), default=0) + 1
    first, second = (part * most + rank for part, rank in zip(parts, ranks, strict=True))
    return first, second


def _rank_among_equals(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """Of each value, how many equal ones come before it."""
    order = np.argsort(values, kind="stable")
    starts = np.flatnonzero(np.diff(values[order], prepend=-1))
    counts = np.diff(starts, append=len(values))
    rank = np.empty(len(values), np.int64)
    rank[order] = np.arange(len(values)) - np.repeat(starts, counts)
    return rank
