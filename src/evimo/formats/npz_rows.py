"""The events of a NumPy archive as columns of numbers, however they lie in it."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile
from evimo.formats.columns import LETTERS, check_lengths, found_columns, named_columns, sized_columns
from evimo.formats.npz_members import Archive, ArrayHeader, Stream, skip

BLOCK_ROWS = 1 << 16
EVENTS, EVIMO2 = "events", "dataset_events_t"
NUMBERS = "iufbmM"  # of NumPy's kinds: times of days among them

Columns = list[NDArray[Any]]
"""t, x, y, p as stored."""


class NpzRows:
    """Where an archive holds its events: rows or fields of `events` or the one array there is, or four arrays.

    Raises:
        BadFile: it holds neither, or arrays of unequal length.
    """

    def __init__(self, archive: Archive, columns: str | None) -> None:
        self._archive, self._order, names = archive, "", sorted(archive.names)
        self._whole = EVENTS if EVENTS in names or len(names) != 1 else names[0]
        if self._whole in names:
            self._headers = {self._whole: archive.header(self._whole)}
            self._order = self._order_of(self._headers[self._whole], columns)
        else:
            named = dict(zip(named_columns(names) or "", names, strict=False))
            if not named:
                held = ", ".join(names[:8])
                fix = "save the rows t x y p as `events`"
                if any(name.endswith(EVIMO2) for name in names):
                    fix = "unpack it, and give the folder: it holds a recording of EVIMO2"
                raise BadFile(f"{archive.path.name} holds no array `events`, only {held}", fix=fix)
            self._headers = {named[letter]: archive.header(named[letter]) for letter in LETTERS}
        lengths = {
            name: _length(archive.path, name, header, by_row=name == self._whole)
            for name, header in self._headers.items()
        }
        check_lengths(archive.path, lengths)
        self.count = min(lengths.values())

    def blocks(self, row: int = 0) -> Iterator[tuple[int, Columns]]:
        """The events from a row on, in blocks: (first row, columns t x y p as stored)."""
        for block in self._by_row(row) if self._is_by_row() else self._by_column(row):
            yield row, block
            row += len(block[0])

    def _is_by_row(self) -> bool:
        header = self._headers.get(self._whole)
        return header is not None and (header.dtype.names is not None or not header.fortran_order)

    def _order_of(self, header: ArrayHeader, columns: str | None) -> str:
        """The letters of the array's columns or fields."""
        name, fields = self._archive.path.name, header.dtype.names
        if fields is not None:
            if (order := named_columns(fields)) is None:
                raise BadFile(f"`{self._whole}` in {name} has the fields {fields}, not t, x, y, p", fix="name them so")
            return order
        if len(header.shape) != 2 or not 4 <= header.shape[1] <= 8 or header.dtype.kind not in "iuf":
            raise BadFile(
                f"`{self._whole}` in {name} has shape {header.shape} of {header.dtype}",
                fix="save it as (N, 4) numbers: t x y p",
            )
        if columns:
            return sized_columns(columns, header.shape[1])
        self._order = "txyp".ljust(header.shape[1], "_")
        _, first = next(self._raw_first(header), (0, np.zeros((0, header.shape[1]))))
        return found_columns(self._archive.path, first[:5000]) if len(first) else self._order

    def _raw_first(self, header: ArrayHeader) -> Iterator[tuple[int, NDArray[np.float64]]]:
        width = header.shape[1]
        blocks = self._rows_of(header, 0) if not header.fortran_order else self._columns_of(header, 0)
        for block in blocks:
            yield 0, np.stack([np.asarray(column, np.float64) for column in block[:width]], axis=1)

    def _by_row(self, row: int) -> Iterator[Columns]:
        header = self._headers[self._whole]
        at = [self._order.index(letter) for letter in LETTERS]
        for block in self._rows_of(header, row):
            yield [block[each] for each in at]

    def _rows_of(self, header: ArrayHeader, row: int) -> Iterator[Columns]:
        names = header.dtype.names
        width = 1 if names else header.shape[1]
        row_bytes = header.dtype.itemsize * width
        stream = self._archive.stream(self._whole)
        skip(stream, header.offset + row * row_bytes)
        while len(raw := stream.read(BLOCK_ROWS * row_bytes)) >= row_bytes:
            flat = np.frombuffer(raw[: len(raw) // row_bytes * row_bytes], header.dtype)
            yield [flat[name] for name in names] if names else list(flat.reshape(-1, width).T)

    def _by_column(self, row: int) -> Iterator[Columns]:
        if header := self._headers.get(self._whole):
            at = [self._order.index(letter) for letter in LETTERS]
            for block in self._columns_of(header, row):
                yield [block[each] for each in at]
            return
        parts: list[tuple[Stream, np.dtype[Any]]] = []
        for name, header in self._headers.items():
            stream = self._archive.stream(name)
            skip(stream, header.offset + row * header.dtype.itemsize)
            parts.append((stream, header.dtype))
        yield from _in_step(parts, self.count - row)

    def _columns_of(self, header: ArrayHeader, row: int) -> Iterator[Columns]:
        """Column after column in the file: one stream for each."""
        rows, item = header.shape[0], header.dtype.itemsize
        parts: list[tuple[Stream, np.dtype[Any]]] = []
        for column in range(header.shape[1]):
            stream = self._archive.stream(self._whole)
            skip(stream, header.offset + (column * rows + row) * item)
            parts.append((stream, header.dtype))
        yield from _in_step(parts, rows - row)


def _length(path: Path, name: str, header: ArrayHeader, *, by_row: bool) -> int:
    """How many events an array holds: rows of one with all columns, else as many as it is long, along whichever axis.

    Raises:
        BadFile: it has several columns, or no numbers.
    """
    shape, fields = header.shape, header.dtype.names or ()
    letters = named_columns(fields) or ""
    used = [header.dtype[field] for field, letter in zip(fields, letters, strict=False) if letter != "_"]
    if any(dtype.kind not in NUMBERS for dtype in used or [header.dtype]):
        raise BadFile(f"`{name}` in {path.name} is of {header.dtype}", fix="save numbers")
    if not by_row and len(shape) > 1 and max(shape) < math.prod(shape):
        raise BadFile(
            f"`{name}` in {path.name} has shape {shape}, not one number for each event", fix="save it as (N,)"
        )
    return (shape[0] if by_row else math.prod(shape)) if shape else 0


def _in_step(parts: list[tuple[Stream, np.dtype[Any]]], rows: int) -> Iterator[Columns]:
    """Blocks of as many values of each stream."""
    while rows > 0:
        raw = [stream.read(min(BLOCK_ROWS, rows) * dtype.itemsize) for stream, dtype in parts]
        whole = min(len(part) // dtype.itemsize for part, (_, dtype) in zip(raw, parts, strict=True))
        if not whole:
            return
        yield [
            np.frombuffer(part[: whole * dtype.itemsize], dtype) for part, (_, dtype) in zip(raw, parts, strict=True)
        ]
        rows -= whole
