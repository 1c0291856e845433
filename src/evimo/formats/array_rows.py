"""Rows of one array in an .npz file, a few at a time: read forward, never unpickled."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile
from evimo.formats.npz_members import Archive, ArrayHeader, Stream, skip


class Rows:
    """The rows of one member, in constant memory: forward from the last ones, or from the start again.

    header: shape and type of the whole array.
    """

    def __init__(self, archive: Archive, name: str, *, dimensions: int, kinds: str, fix: str) -> None:
        """Look at its header.

        Args:
            archive: that holds it.
            name: of the array.
            dimensions: that it must have.
            kinds: NumPy's letters of the types that it may have, such as "iuf".
            fix: of the error when it is otherwise.

        Raises:
            BadFile: it is not there, or is otherwise.
        """
        self._archive, self._name, self._fix = archive, name, fix
        if name not in archive.names:
            raise BadFile(f"{archive.path} lacks `{name}`", fix=fix)
        self.header: ArrayHeader = archive.header(name)
        header = self.header
        turned = header.fortran_order and len(header.shape) > 1
        if len(header.shape) != dimensions or turned or header.dtype.kind not in kinds:
            order = ", in Fortran's order" if turned else ""
            raise BadFile(f"`{name}` of {archive.path} is {header.shape} {header.dtype}{order}", fix=fix)
        self._stream: Stream | None = None
        self._next = 0

    def __len__(self) -> int:
        return self.header.shape[0]

    def read(self, first: int, last: int) -> NDArray[Any]:
        """Rows first <= k < last.

        Raises:
            BadFile: the file is cut short.
        """
        shape = (last - first, *self.header.shape[1:])
        row_bytes = math.prod(shape[1:]) * self.header.dtype.itemsize
        if self._stream is None or first < self._next:
            self._stream, self._next = self._archive.stream(self._name), 0
            skip(self._stream, self.header.offset)
        skip(self._stream, row_bytes * (first - self._next))
        self._next = last
        raw = self._stream.read(row_bytes * shape[0])
        if len(raw) < row_bytes * shape[0]:
            raise BadFile(f"`{self._name}` of {self._archive.path} is cut short", fix=self._fix)
        return np.frombuffer(raw, self.header.dtype).reshape(shape)
