"""Unpacking alone, for the table of `readers.py`: the library that unpacks a format's bytes, with nothing decoded.

No reader of a packed format can be faster than that, but by more than one core.
"""

import zipfile
from collections.abc import Callable
from pathlib import Path

import h5py
import hdf5plugin  # noqa: F401 (the filters that HDF5 finds once it is loaded)
import lz4.frame
import numpy as np
from rosbags.rosbag2 import Reader

from evimo.formats.aedat4_packets import head, packet_table

PART_BYTES = 1 << 19


def npz(path: Path) -> None:
    """The array of events, in blocks."""
    with zipfile.ZipFile(path) as file, file.open("events.npy") as member:
        while member.read(PART_BYTES):
            pass


def hdf5(path: Path) -> None:
    """Each column, chunk by chunk into one piece of memory."""
    with h5py.File(path) as file:
        for name in "xytp":
            column = file[f"events/{name}"]
            (rows,) = column.chunks
            into = np.empty(rows, column.dtype)
            for first in range(0, len(column), rows):
                last = min(first + rows, len(column))
                column.read_direct(into, np.s_[first:last], np.s_[: last - first])


def aedat4(path: Path) -> None:
    """Packet by packet."""
    table = packet_table(path, head(path))
    assert table is not None
    with path.open("rb", buffering=0) as file:
        for offset in table.offset.tolist():
            file.seek(offset + 4)
            lz4.frame.decompress(file.read(int.from_bytes(file.read(4), "little")))


def mcap(path: Path) -> None:
    """Message by message."""
    with Reader(path) as reader:
        for _ in reader.messages():
            pass


# By the beginning of the format's name in the table.
UNPACKING: dict[str, Callable[[Path], None]] = {
    "EV-IMO npz, compressed": npz,
    "HDF5 (DSEC, blosc)": hdf5,
    "AEDAT 4 (LZ4)": aedat4,
    "ROS 2 bag, mcap lz4": mcap,
    "ROS 2 bag, mcap zstd": mcap,
}


def unpacking_of(name: str) -> Callable[[Path], None] | None:
    """What unpacks a format; None where it is not packed."""
    return next((unpack for start, unpack in UNPACKING.items() if name.startswith(start)), None)
