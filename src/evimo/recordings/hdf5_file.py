"""HDF5 files on disks that fill up: HDF5 itself cannot bear a failed write, and crashes when the program ends."""

import os
from pathlib import Path
from typing import Any

import h5py

from evimo.writing import in_utf8


class Hdf5File:
    """A new HDF5 file that says when its disk fails, and that can always be closed.

    content: the open `h5py.File`. Call `check` after changing it.
    """

    def __init__(self, path: Path, *, attributes: dict[str, str]) -> None:
        """Begin the file, with attributes such as the model's name.

        Raises:
            OSError: it cannot be written.
        """
        self._disk = _Disk(path)
        self.content: Any = h5py.File(self._disk, "w")
        # HDF5 takes UTF-8 alone, which not every file's name is in.
        self.content.attrs.update({name: in_utf8(words) for name, words in attributes.items()})
        self.content.flush()
        if self._disk.failure is not None:
            self.close()

    def check(self) -> None:
        """Make sure that what was written has arrived.

        Raises:
            OSError: it has not, and the file is useless.
        """
        if self._disk.failure is not None:
            raise self._disk.failure

    def close(self) -> None:
        """Finish the file.

        Raises:
            OSError: as `check`.
        """
        try:
            self.content.close()
        finally:
            self._disk.close()
        self.check()


class _Disk:
    """What HDF5 takes for a file: from its first failure on, `failure`, writes are kept in memory, and succeed.

    After that the file is closed at once, so that there is little to keep.
    """

    def __init__(self, path: Path) -> None:
        self.failure: OSError | None = None
        self._file = path.open("w+b", buffering=0)
        self._at, self._size = 0, 0
        self._kept: list[tuple[int, bytes]] = []

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """As of any file."""
        self._at = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._size}[whence]
        return self._at

    def tell(self) -> int:
        """As of any file."""
        return self._at

    def write(self, content: Any) -> int:
        """As of any file, whatever the disk does."""
        rest = memoryview(content).cast("B")
        start, count = self._at, len(rest)
        self._at += count
        self._size = max(self._size, self._at)
        try:
            if self.failure is None:
                self._file.seek(start)
                while len(rest):
                    rest = rest[self._file.write(rest) :]
                return count
        except OSError as error:
            self.failure = error
        self._kept.append((self._at - len(rest), bytes(rest)))
        return count

    def read(self, count: int) -> bytes:
        """As of any file; by this method h5py knows one."""
        found = bytearray(count)
        self.readinto(found)
        return bytes(found)

    def readinto(self, into: Any) -> int:
        """As of any file; beyond its end are zeros."""
        target, start = memoryview(into).cast("B"), self._at
        self._file.seek(start)
        found = self._file.read(len(target)) or b""
        target[:] = found + bytes(len(target) - len(found))
        for at, content in self._kept:
            first, last = max(at, start), min(at + len(content), start + len(target))
            if first < last:
                target[first - start : last - start] = content[first - at : last - at]
        self._at += len(target)
        return len(target)

    def truncate(self, size: int | None = None) -> int:
        """As of any file, whatever the disk does."""
        self._size = self._at if size is None else size
        try:
            if self.failure is None:
                self._file.truncate(self._size)
        except OSError as error:
            self.failure = error
        return self._size

    def flush(self) -> None:
        """Nothing is buffered."""

    def close(self) -> None:
        """Close the file; some disks say only now that they are full."""
        try:
            self._file.close()
        except OSError as error:
            self.failure = self.failure or error
