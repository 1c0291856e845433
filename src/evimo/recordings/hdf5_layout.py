"""A recording with truth as one HDF5 file: everything in chunks that are read on their own, nothing pickled.

events/x y t p   (N,), t in µs        truth/depth mask clutter  (F, H, W), a frame a chunk
events/ids       (N,), where known    sim/…  motions and poses   imu/…     attribute `evimo`: JSON
"""

import zlib
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile
from evimo.formats.event_file import EventFile, FoundCamera
from evimo.formats.hdf5 import open_hdf5
from evimo.formats.hdf5_file import opened_hdf5
from evimo.geometry.camera import Camera
from evimo.recordings.facts import DAMAGED, MARK, facts_of
from evimo.recordings.imu import IMU_ARRAYS

Arrays = dict[str, NDArray[Any]]
CHUNK_EVENTS = 1 << 16
DAMAGES = (OSError, RuntimeError, KeyError, ValueError, TypeError, zlib.error)


def is_own_hdf5(path: Path) -> bool:
    """Whether a file is HDF5 that this package wrote with truth in it."""
    try:
        with opened_hdf5(path) as file:
            return MARK in file.attrs and "truth" in file
    except DAMAGES:
        return False


class Hdf5Parts:
    """The parts of such a file, each read when it is asked for."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def events(self) -> EventFile:
        """The events, chunk by chunk."""
        lens: dict[str, Any] = dict(facts_of(self.path)["camera"])
        lens["distortion"] = tuple(lens["distortion"])
        camera = Camera(**lens)
        found = open_hdf5(self.path, camera.size, time_unit="us", topic="events")
        found.camera = FoundCamera(camera, f"{MARK} in {self.path.name}")
        return found

    def motions(self, names: tuple[str, ...]) -> Arrays:
        """From the group `sim`."""
        with _opened(self.path) as file:
            return {name: file["sim"][name][()] for name in names}

    def imu(self) -> Arrays | None:
        """From the group `imu`."""
        with _opened(self.path) as file:
            return {name: file["imu"][name][()] for name in IMU_ARRAYS} if "imu" in file else None

    def event_ids(self) -> NDArray[Any] | None:
        """`events/ids`, whole."""
        with _opened(self.path) as file:
            return file["events/ids"][()] if "ids" in file["events"] else None

    def event_count(self) -> int:
        """Rows of the events."""
        with _opened(self.path) as file:
            return int(file["events/t"].shape[0])

    def map(self, name: str, k: int) -> NDArray[Any]:
        """One chunk."""
        with _opened(self.path) as file:
            return file["truth"][name][k]


@contextmanager
def _opened(path: Path) -> Generator[Any]:
    """The file; what is wrong with it is one error.

    Raises:
        BadFile: a part is missing or damaged.
    """
    try:
        with opened_hdf5(path) as file:
            yield file
    except DAMAGES as error:
        raise BadFile(f"{path} is damaged: {error}", fix=DAMAGED) from error


def grown(file: h5py.File, name: str, values: NDArray[Any]) -> None:
    """Append rows to an array of the file, which is made with the first ones.

    Maps (n, H, W) have a chunk for each; other arrays one for each 65536 rows.
    """
    if name not in file:
        chunk = (1, *values.shape[1:]) if values.ndim == 3 else (CHUNK_EVENTS, *values.shape[1:])
        file.create_dataset(
            name,
            (0, *values.shape[1:]),
            values.dtype,
            maxshape=(None, *values.shape[1:]),
            chunks=chunk,
            compression="gzip",
            compression_opts=1,
            shuffle=True,
        )
    array: Any = file[name]
    first = array.shape[0]
    array.resize(first + len(values), axis=0)
    array[first:] = np.ascontiguousarray(values)
