"""Where the parts of a stored recording lie: a folder in the layout of EVIMO2, or an .npz file in that of EV-IMO."""

from pathlib import Path
from typing import Any, Protocol

from numpy.typing import NDArray

from evimo.errors import BadFile
from evimo.formats.array_rows import Rows
from evimo.formats.event_file import EventFile
from evimo.formats.evimo2 import mapped, open_evimo2
from evimo.formats.evimo_npz import open_evimo_npz
from evimo.formats.npz_members import Archive
from evimo.recordings.facts import DAMAGED
from evimo.recordings.hdf5_layout import Hdf5Parts
from evimo.recordings.imu import IMU_ARRAYS

Arrays = dict[str, NDArray[Any]]
ARCHIVED = {"depth": "depth", "mask": "mask", "clutter": "sim_clutter"}


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


def own_parts(path: Path) -> StoredParts:
    """The parts of a recording that this package wrote, in any of its layouts."""
    if path.is_dir():
        return FolderParts(path)
    return ArchiveParts(path) if path.suffix == ".npz" else Hdf5Parts(path)


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
        self._maps: dict[str, Rows] = {}

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
            self._maps[name] = Rows(self.archive, ARCHIVED[name], dimensions=3, kinds="iuf", fix=DAMAGED)
        return self._maps[name].read(k, k + 1)[0]

    def _named(self, prefix: str, names: tuple[str, ...]) -> Arrays:
        arrays = arrays_of(self.path, tuple(prefix + name for name in names))
        return {name: arrays[prefix + name] for name in names}


def arrays_of(path: Path, names: tuple[str, ...]) -> Arrays:
    """Arrays of an npz file by name.

    Raises:
        BadFile: there is no such file, or no such array in it that needs no unpickling.
    """
    if not path.exists():
        raise BadFile(f"{path.parent} lacks {path.name}", fix=DAMAGED)
    archive = Archive(path)
    if missing := [name for name in names if name not in archive.names]:
        raise BadFile(f"{path} lacks `{missing[0]}`", fix=DAMAGED)
    return {name: archive.whole(name) for name in names}
