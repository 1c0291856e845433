"""Opening of HDF5 files to read them, with a look at their head before HDF5's own library takes it at its word."""

import struct
from pathlib import Path
from typing import IO

import h5py

SIGNATURE = b"\x89HDF\r\n\x1a\n"
OLD_VERSIONS = (0, 1)  # of the head; later ones have a checksum
NOWHERE = (1 << 64) - 1
SMALLEST_BLOCK = 512  # bytes that may lie before the head, or twice as many, and so on


def opened_hdf5(path: Path) -> h5py.File:
    """Open an HDF5 file to read it.

    Of a damaged head the library would take a number for the size of a block, and ask for as much memory.

    Raises:
        OSError: it is none, damaged, or cannot be read.
    """
    with path.open("rb") as file:
        if _driver_block(file) not in (None, NOWHERE):
            raise OSError("its head names a driver, as those of files in several parts do")
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
