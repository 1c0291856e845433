"""Members of NumPy archives as streams: shapes without data, data without memory, nothing ever unpickled.

An archive that was cut short has lost the table at its end; its members are then found by walking from the front.
"""

import io
import math
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any, NamedTuple, Protocol

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from evimo.errors import BadFile
from evimo.formats.pickled import plain_value

LOCAL_HEADER = struct.Struct("<4s5H3L2H")
SIZES_IN_EXTRA = 0xFFFFFFFF
CHUNK_BYTES = 1 << 18
MOST_PICKLED = 1 << 29  # bytes; an hour of poses is a fifth of it
DAMAGED = (
    *(zipfile.BadZipFile, zlib.error, struct.error),
    *(EOFError, OSError, ValueError, NotImplementedError, RuntimeError),
)
"""What Python's own reader of archives says of damaged ones: NotImplementedError of a compression that nobody has,
RuntimeError of a password, ValueError and OSError of places before the file's beginning."""


class ArrayHeader(NamedTuple):
    """Shape, order and type of a stored array, and where its first value lies in the member."""

    shape: tuple[int, ...]
    fortran_order: bool
    dtype: np.dtype[Any]
    offset: int


class Stream(Protocol):
    """What is needed of a member: to be read forward."""

    def read(self, size: int, /) -> bytes:
        """At most `size` bytes; fewer only at the end."""
        ...


class Archive:
    """The members of an .npz file, whole or cut short.

    Raises:
        BadFile: no member can be found.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._zip: zipfile.ZipFile | None = None
        self._places: dict[str, tuple[int, int]] = {}  # name to offset of its data and method, of a cut archive
        try:
            self._zip = zipfile.ZipFile(path)
            members = self._zip.namelist()
        except DAMAGED:
            self._places = dict(_walk(path))
            members = list(self._places)
        self.cut_short = self._zip is None
        self.names = {name.removesuffix(".npy") for name in members if name.endswith(".npy")}
        if not self.names:
            raise BadFile(f"{path.name} is a zip archive without NumPy arrays", fix="give an .npz recording")

    def stream(self, name: str) -> Stream:
        """Return the bytes of a member, from its start.

        Raises:
            BadFile: the table of the archive points to something else.
        """
        if self._zip is not None:
            try:
                return _Checked(self._zip.open(f"{name}.npy"))
            except DAMAGED as error:
                raise BadFile(f"`{name}` in {self.path.name} is damaged: {error}", fix="copy the file again") from error
        offset, method = self._places[f"{name}.npy"]
        return _Salvaged(self.path, offset, deflated=method == zipfile.ZIP_DEFLATED)

    def header(self, name: str) -> ArrayHeader:
        """Shape and type of a member, without its data.

        Raises:
            BadFile: it holds Python objects, or is no array.
        """
        return array_header(self.stream(name), f"`{name}` in {self.path.name}")

    def is_pickled(self, name: str) -> bool:
        """Whether a member is an array of Python objects."""
        return array_header(self.stream(name), f"`{name}` in {self.path.name}", objects=True).dtype.hasobject

    def value(self, name: str) -> Any:
        """A member of no dimension: text, or the plain value that a pickle holds, which is read without running it.

        Raises:
            BadFile: it is of another kind, a pickle of more than plain values, or damaged.
        """
        what = f"`{name}` in {self.path.name}"
        stream = self.stream(name)
        header = array_header(stream, what, objects=True)
        if header.dtype.kind not in "OU" or math.prod(header.shape) != 1:
            raise BadFile(f"{what} is {header.shape} {header.dtype}", fix="a text, or one pickled value")
        if header.dtype.kind == "U":
            return self.whole(name).reshape(-1)[0].item()
        raw = stream.read(MOST_PICKLED + 1)
        if len(raw) > MOST_PICKLED:
            raise BadFile(f"{what} is a pickle of more than {MOST_PICKLED >> 20} MB", fix="copy the file again")
        return plain_value(io.BytesIO(raw), what)

    def small(self, name: str) -> NDArray[Any]:
        """A whole member of at most a thousand values, such as a matrix."""
        header = self.header(name)
        count = math.prod(header.shape)
        if count > 1000:
            raise BadFile(f"`{name}` in {self.path.name} has {count} values", fix="check what the file holds")
        return self.whole(name)

    def whole(self, name: str) -> NDArray[Any]:
        """A whole member.

        Raises:
            BadFile: it is cut short, holds Python objects, or is no array.
        """
        header = self.header(name)
        count = math.prod(header.shape)
        stream = self.stream(name)
        skip(stream, header.offset)
        raw = stream.read(count * header.dtype.itemsize)
        if len(raw) < count * header.dtype.itemsize:
            raise BadFile(f"`{name}` in {self.path.name} is cut short", fix="copy the file again")
        return np.frombuffer(raw, header.dtype).reshape(header.shape, order="F" if header.fortran_order else "C")


def array_header(stream: Stream, what: str, *, objects: bool = False) -> ArrayHeader:
    """The header of a .npy stream, left at its first value.

    Raises:
        BadFile: Python objects, which only unpickling could read and which may run code, unless `objects` says that
            the caller does not unpickle; or no array.
    """
    counted = _Counted(stream)
    try:
        version = npy.read_magic(counted)
        if version == (1, 0):
            shape, fortran_order, dtype = npy.read_array_header_1_0(counted)
        else:
            shape, fortran_order, dtype = npy.read_array_header_2_0(counted)
    except (ValueError, TypeError, SyntaxError, EOFError, tokenize.TokenError, RecursionError, MemoryError) as error:
        raise BadFile(f"{what} is no whole NumPy array", fix="copy or export it again") from error
    if dtype.hasobject and not objects:
        raise BadFile(
            f"{what} holds Python objects (a pickle), which may run code when read: refused",
            fix="save it as an array of numbers",
        )
    if min(shape, default=0) < 0 or math.prod(shape) * dtype.itemsize >= 2**63:
        raise BadFile(f"{what} has the impossible shape {shape}", fix="copy or export it again")
    return ArrayHeader(shape, fortran_order, dtype, counted.count)


def skip(stream: Stream, size: int) -> None:
    """Move forward by `size` bytes."""
    seek = getattr(stream, "seek", None)
    if seek is not None:
        seek(size)
        return
    while size > 0 and (got := len(stream.read(min(size, CHUNK_BYTES)))):
        size -= got


class _Counted:
    """A stream that counts what was read."""

    def __init__(self, stream: Stream) -> None:
        self._stream = stream
        self.count = 0

    def read(self, length: int = -1, /) -> bytes:
        raw = self._stream.read(length)
        self.count += len(raw)
        return raw


class _Checked:
    """A member of a whole archive; damaged data end the stream, as a cut would."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file

    def read(self, size: int) -> bytes:
        try:
            return self._file.read(size)
        except DAMAGED:
            return b""

    def seek(self, size: int) -> None:
        try:
            self._file.seek(size, 1)
        except DAMAGED:
            return


class _Salvaged:
    """A member of an archive without its table: inflated from the front as far as it goes."""

    def __init__(self, path: Path, offset: int, *, deflated: bool) -> None:
        self._file = path.open("rb")
        self._file.seek(offset)
        self._inflate = zlib.decompressobj(-zlib.MAX_WBITS) if deflated else None
        self._ready = b""

    def read(self, size: int) -> bytes:
        parts, have = [self._ready], len(self._ready)
        while have < size and (more := self._more()):
            parts.append(more)
            have += len(more)
        whole = b"".join(parts)
        self._ready = whole[size:]
        return whole[:size]

    def _more(self) -> bytes:
        inflate = self._inflate
        if inflate is None:
            return self._file.read(CHUNK_BYTES)
        while not inflate.eof:
            raw = inflate.unconsumed_tail or self._file.read(CHUNK_BYTES)
            if not raw:
                return b""
            try:
                inflated = inflate.decompress(raw, CHUNK_BYTES)
            except zlib.error:
                return b""
            if inflated:
                return inflated
        return b""


def _walk(path: Path) -> Iterator[tuple[str, tuple[int, int]]]:
    """Name, offset of the data and method of each member, from the headers in front of them."""
    end = path.stat().st_size
    with path.open("rb") as file:
        at = 0
        while at + LOCAL_HEADER.size < end:
            file.seek(at)
            fields = LOCAL_HEADER.unpack(file.read(LOCAL_HEADER.size))
            magic, method, packed, name_size, extra_size = fields[0], fields[3], fields[7], fields[9], fields[10]
            if magic != b"PK\x03\x04":
                return
            name = file.read(name_size).decode(errors="replace")
            extra = file.read(extra_size)
            yield name, (file.tell(), method)
            if packed == SIZES_IN_EXTRA and len(extra) >= 20:
                packed = struct.unpack_from("<Q", extra, 12)[0]
            if not packed:
                return
            at = file.tell() + packed
