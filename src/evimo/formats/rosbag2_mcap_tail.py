"""An mcap file that was cut short, shown to a reader as if it had been closed after its last whole record."""

import io
import struct
from pathlib import Path
from typing import Any, BinaryIO

MAGIC = b"\x89MCAP0\r\n"
FOOTER = b"\x02" + struct.pack("<QQQI", 20, 0, 0, 0)  # without a summary: readers then walk the records
FOOTER_START = FOOTER[:9]


def is_cut(path: Path) -> bool:
    """Whether the end of a closed file is missing."""
    size = len(FOOTER) + len(MAGIC)
    with path.open("rb") as file:
        if file.seek(0, io.SEEK_END) < size:
            return True
        file.seek(-size, io.SEEK_END)
        end = file.read()
    return not (end.startswith(FOOTER_START) and end.endswith(MAGIC))


def whole_size(file: BinaryIO) -> int:
    """How many bytes the whole records of a file take, each a kind, its size and so many bytes."""
    end, at = file.seek(0, io.SEEK_END), len(MAGIC)
    while at + 9 <= end:
        file.seek(at)
        kind, size = struct.unpack("<BQ", file.read(9))
        if at + 9 + size > end or kind == FOOTER[0]:
            break
        at += 9 + size
    return at


class CutMcap:
    """The path of a file that was cut; what it opens ends as a closed file does."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __str__(self) -> str:
        return str(self._path)

    def open(self, mode: str) -> BinaryIO:
        """Open it to be read."""
        return io.BufferedReader(_Tailed(self._path.open("rb", buffering=0)))


class _Tailed(io.RawIOBase):
    """The whole records of a file, then a footer and the closing mark."""

    def __init__(self, file: Any) -> None:
        self._file, self._whole, self._at = file, whole_size(file), 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        end = self._whole + len(FOOTER) + len(MAGIC)
        self._at = offset + (0, self._at, end)[whence]
        return self._at

    def tell(self) -> int:
        return self._at

    def readinto(self, buffer: Any, /) -> int:
        view = memoryview(buffer).cast("B")
        if self._at < self._whole:
            self._file.seek(self._at)
            count = self._file.readinto(view[: self._whole - self._at])
        else:
            rest = (FOOTER + MAGIC)[self._at - self._whole :][: len(view)]
            count = len(rest)
            view[:count] = rest
        self._at += count
        return count

    def close(self) -> None:
        self._file.close()
        super().close()
