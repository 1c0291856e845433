"""Opening of HDF5 files to read them, with a look at what HDF5's own library takes at its word.

Damaged, a head has it ask for gigabytes of memory, and a heap of strings has it read for ever.
"""

import struct
from pathlib import Path
from typing import IO

import h5py

SIGNATURE = b"\x89HDF\r\n\x1a\n"
OLD_VERSIONS = (0, 1)  # of the head; later ones have a checksum
HEAP = b"GCOL\1\0\0\0"  # of strings of any length, such as those of attributes
HEAP_HEAD = OBJECT_HEAD = 16  # bytes
ENDS_BYTES = 1 << 20  # of the file's beginning and its end, where such heaps lie
NOWHERE = (1 << 64) - 1
SMALLEST_BLOCK = 512  # bytes that may lie before the head, or twice as many, and so on


def opened_hdf5(path: Path) -> h5py.File:
    """Open an HDF5 file to read it.

    Raises:
        OSError: it is none, damaged, or cannot be read.
    """
    with path.open("rb") as file:
        if _driver_block(file) not in (None, NOWHERE):
            raise OSError("its head names a driver, as those of files in several parts do")
        for start in {0, max(path.stat().st_size - ENDS_BYTES, 0)}:
            file.seek(start)
            _check_heaps(file.read(ENDS_BYTES))
    return h5py.File(path, "r")


def _driver_block(file: IO[bytes]) -> int | None:
    """Where the head says that the settings of a driver lie; None where it is none, or of a later version."""
    at = 0
    while True:
        file.seek(at)
        head = file.read(64)
        if len(head) < 64:
            return None
        if head.startswith(SIGNATURE):
            break
        at = max(2 * at, SMALLEST_BLOCK)
    version, bytes_of_place = head[8], head[13]
    if version not in OLD_VERSIONS or bytes_of_place != 8:
        return None
    return struct.unpack_from("<Q", head, (24, 28)[version] + 24)[0]


def _check_heaps(raw: bytes) -> None:
    """Refuse heaps with an object of no size, over which the library would not come.

    Raises:
        OSError: there is one.
    """
    heap = raw.find(HEAP)
    while heap >= 0:
        (size,) = struct.unpack_from("<Q", raw.ljust(heap + HEAP_HEAD), heap + len(HEAP))
        at, end = heap + HEAP_HEAD, heap + size
        while at + OBJECT_HEAD <= min(end, len(raw)):
            number, content = struct.unpack_from("<H6xQ", raw, at)
            length = OBJECT_HEAD + -(-content // 8) * 8 if number else content
            if not OBJECT_HEAD <= length <= end - at:
                raise OSError("a heap of strings is damaged")
            at += length
        heap = raw.find(HEAP, heap + 1)
