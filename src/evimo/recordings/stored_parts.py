"""Where the parts of a stored recording lie: a folder in the layout of EVIMO2, or an .npz file in that of EV-IMO."""

import zipfile
import zlib
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile
from evimo.formats.event_file import EventFile
from evimo.formats.evimo2 import mapped, open_evimo2
from evimo.formats.evimo_npz import open_evimo_npz
from evimo.formats.npz_members import Archive, ArrayHeader, Stream, skip
from evimo.recordings.facts import DAMAGED
from evimo.recordings.imu import IMU_ARRAYS

Arrays = dict[str, NDArray[Any]]
ARCHIVED = {"depth": "depth", "mask": "mask", "clutter": "sim_clutter"}
DAMAGES = (ValueError, KeyError, OSError, EOFError, zipfile.BadZipFile, zlib.error)


class StoredParts(Protocol):
    """Parts of one recording, each read when it is asked for; nothing is ever unpickled.

    Raises:
        BadFile: a part is missing or damaged.
    """

    path: Path

    def events(self) -> EventFile:
        """The events."""
        ...

    def motions(self, names: tuple[str, ...]) -> Arrays:
        """Exact motions by name."""
        ...

    def imu(self) -> Arrays | None:
        """What the inertial measurement unit says, by name; None where there is none."""
        ...

    def event_ids(self) -> NDArray[Any] | None:
        """As stored; None where there are none."""
        ...

    def event_count(self) -> int:
        """How many events are stored."""
        ...

    def map(self, name: str, k: int) -> NDArray[Any]:
        """`depth`, `mask` or `clutter` (H, W) of instant k, as stored."""
        ...


class FolderParts:
    """A folder in the layout of EVIMO2, version 2."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def events(self) -> EventFile:
        """The events, memory-mapped."""
        return open_evimo2(self.path)

    def motions(self, names: tuple[str, ...]) -> Arrays:
        """From `dataset_sim.npz`."""
        return arrays_of(self._file("sim.npz"), names)

    def imu(self) -> Arrays | None:
        """From `dataset_imu.npz`."""
        path = self._file("imu.npz")
        return arrays_of(path, IMU_ARRAYS) if path.exists() else None

    def event_ids(self) -> NDArray[Any] | None:
        """`dataset_events_id.npy`, memory-mapped."""
        path = self._file("events_id.npy")
        return mapped(path) if path.exists() else None

    def event_count(self) -> int:
        """Rows of `dataset_events_t.npy`."""
        return len(mapped(self._file("events_t.npy")))

    def map(self, name: str, k: int) -> NDArray[Any]:
        """One member of `dataset_depth.npz` and its like."""
        key = f"{name}_{k:010d}"
        return arrays_of(self._file(f"{name}.npz"), (key,))[key]

    def _file(self, name: str) -> Path:
        return self.path / f"dataset_{name}"


class ArchiveParts:
    """An .npz file in the layout of EV-IMO's first version; maps are read fastest in their order."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.archive = Archive(path)
        self._maps: dict[str, _MapsInARow] = {}

    def events(self) -> EventFile:
        """The events, streamed."""
        return open_evimo_npz(self.path)

    def motions(self, names: tuple[str, ...]) -> Arrays:
        """From the arrays `sim_`."""
        return self._named("sim_", names)

    def imu(self) -> Arrays | None:
        """From the arrays `sim_imu_`."""
        return self._named("sim_imu_", IMU_ARRAYS) if "sim_imu_t_us" in self.archive.names else None

    def event_ids(self) -> NDArray[Any] | None:
        """`sim_event_ids`, whole: one byte per event."""
        name = "sim_event_ids"
        return arrays_of(self.path, (name,))[name] if name in self.archive.names else None

    def event_count(self) -> int:
        """Rows of `events`."""
        return self.archive.header("events").shape[0]

    def map(self, name: str, k: int) -> NDArray[Any]:
        """One row of the array."""
        if name not in self._maps:
            self._maps[name] = _MapsInARow(self.archive, ARCHIVED[name])
        return self._maps[name].at(k)

    def _named(self, prefix: str, names: tuple[str, ...]) -> Arrays:
        arrays = arrays_of(self.path, tuple(prefix + name for name in names))
        return {name: arrays[prefix + name] for name in names}


class _MapsInARow:
    """The maps (F, H, W) of one member, one at a time: forward from the last one, or from the start again."""

    def __init__(self, archive: Archive, name: str) -> None:
        if name not in archive.names:
            raise BadFile(f"{archive.path} lacks `{name}`", fix=DAMAGED)
        self.archive, self.name = archive, name
        self.header: ArrayHeader = archive.header(name)
        if len(self.header.shape) != 3 or self.header.fortran_order or self.header.dtype.kind not in "iuf":
            raise BadFile(f"`{name}` of {archive.path} is {self.header.shape} {self.header.dtype}", fix=DAMAGED)
        self._stream: Stream | None = None
        self._next = 0

    def at(self, k: int) -> NDArray[Any]:
        """Map k, (H, W)."""
        size = int(np.prod(self.header.shape[1:])) * self.header.dtype.itemsize
        if self._stream is None or k < self._next:
            self._stream, self._next = self.archive.stream(self.name), 0
            skip(self._stream, self.header.offset)
        skip(self._stream, size * (k - self._next))
        self._next = k + 1
        raw = self._stream.read(size)
        if len(raw) < size:
            raise BadFile(f"`{self.name}` of {self.archive.path} is cut short", fix=DAMAGED)
        return np.frombuffer(raw, self.header.dtype).reshape(self.header.shape[1:])


def arrays_of(path: Path, names: tuple[str, ...]) -> Arrays:
    """Arrays of an npz file by name.

    Raises:
        BadFile: there is no such file, or no such array in it that needs no unpickling.
    """
    if not path.exists():
        raise BadFile(f"{path.parent} lacks {path.name}", fix=DAMAGED)
    try:
        with np.load(path, allow_pickle=False) as archive:
            return {name: archive[name] for name in names}
    except DAMAGES as error:
        raise BadFile(f"{path} is damaged: {error}", fix=DAMAGED) from error
