"""EV-IMO and EVIMO2 recordings as they come: their truth in this package's axes, units and types."""

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, EvimoWarning
from evimo.formats.event_file import EventFile, FoundCamera
from evimo.formats.evimo_meta import Meta, MetaPoses, meta_of, meta_of_text_file
from evimo.formats.npz_members import Archive
from evimo.formats.opening import open_events
from evimo.geometry.camera import Camera
from evimo.recordings.dataset_cameras import (
    AS_WRITTEN,
    MIRRORED,
    RENDERED,
    SWAPPED,
    PrincipalTest,
    as_drawn,
    camera_of,
    is_first_version,
    principal_test,
)
from evimo.recordings.dataset_maps import ArchivedMaps, FolderMaps, Maps, PictureMaps, as_mask, in_mm
from evimo.recordings.paths import Paths, paths_of
from evimo.recordings.pose_words import in_own_axes

Arrays = dict[str, NDArray[Any]]
HEADER_BYTES = 128  # of an array file; there is no more of the events of a camera that takes frames
UNKNOWN = "a pose or a motion that is not known"
DatasetLayout = Literal["EV-IMO npz", "EVIMO2 npz", "EV-IMO text", "EVIMO2 folder"]


@dataclass(slots=True)
class DatasetParts:
    """The parts of one recording that lie in its maps and events; motions come from splines, and are kept here.

    frames: (F,) which entries of `meta`'s frames are used, those with maps and a known motion of everything in them.
    """

    path: Path
    maps: Maps
    frames: NDArray[np.int64]
    camera: Camera
    exact: Arrays

    def events(self) -> EventFile:
        """The events, in the format's own reader; their camera is the one of `meta`."""
        text = self.path / "events.txt"
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "[^:]*: the distortion `D` is ignored", EvimoWarning)
            file = open_events(text if text.exists() else self.path, sensor=self.camera.size)
        file.camera = FoundCamera(self.camera, "meta")
        return file

    def motions(self, names: tuple[str, ...]) -> Arrays:
        """Motions at the frames."""
        return {name: self.exact[name] for name in names}

    def imu(self) -> Arrays | None:
        """None in camera axes."""
        return None

    def event_ids(self) -> NDArray[Any] | None:
        """None."""
        return None

    def event_count(self) -> int:
        """How many events are read, all of them: these layouts do not all say it."""
        return sum(len(packet) for packet in self.events())

    def map(self, name: str, k: int) -> NDArray[Any]:
        """A map in the units of our own files."""
        frame = int(self.frames[k])
        if name == "clutter":
            return np.zeros(self.maps.size, np.uint8)
        values = self.maps.read(name, frame)
        return in_mm(values) if name == "depth" else as_mask(values)


@dataclass(frozen=True, slots=True)
class Dataset:
    """One recording of a dataset: where its parts lie, and what `meta` says.

    first_version: whether its axes and sizes are those of EV-IMO's first version.
    """

    path: Path
    layout: DatasetLayout
    maps: Maps
    meta: Meta
    first_version: bool

    @property
    def where(self) -> str:
        """What to call `meta` in errors."""
        return f"meta of {self.path}"

    def conventions(self) -> dict[str, Camera]:
        """The camera by every convention of its principal point that is possible."""
        names = (AS_WRITTEN, SWAPPED, MIRRORED, RENDERED)
        return {name: camera_of(self.meta.camera, self.maps.size, name, self.where) for name in names}

    @property
    def usual(self) -> str:
        """The convention that the dataset's own program rendered with."""
        return RENDERED if self.first_version else AS_WRITTEN

    def test(self) -> PrincipalTest:
        """Which principal point the maps and poses belong to."""
        frames = [k for k in range(len(self.meta.frames)) if self.maps.has(k)]
        drawn = {name: as_drawn(camera, name) for name, camera in self.conventions().items()}
        return principal_test(self.maps, self.poses(self.meta.frames)[1], drawn, frames)

    def camera(self) -> Camera:
        """The camera: of version 1 by the convention that its own frames agree with."""
        convention = self.test().best(self.usual) if self.first_version else self.usual
        return self.conventions()[convention]

    def poses(self, entries: MetaPoses) -> tuple[NDArray[np.float64], dict[int, NDArray[np.float64]]]:
        """Camera and objects of a list of entries, in this package's axes."""
        if not self.first_version:
            return entries.world_from_cam, entries.cam_from_object
        return in_own_axes(entries.world_from_cam, entries.cam_from_object)

    def paths(self) -> Paths:
        """Splines of everything, from the poses at the mocap's rate where the file has them."""
        entries = self.meta.trajectory if len(self.meta.trajectory) > 1 else self.meta.frames
        return paths_of(entries.times_us, *self.poses(entries))


def dataset_layout(path: Path) -> DatasetLayout | None:
    """Which layout of the datasets a file or folder is in, be it whole or damaged; None where in none."""
    if path.is_dir():
        if (path / "meta.txt").exists() and (path / "events.txt").exists():
            return "EV-IMO text"
        times = path / "dataset_events_t.npy"
        with_events = times.exists() and times.stat().st_size > HEADER_BYTES
        return "EVIMO2 folder" if with_events and (path / "dataset_info.npz").exists() else None
    if path.suffix == ".npz" and path.is_file() and not path.name.startswith("dataset_"):
        names = Archive(path).names
        return "EV-IMO npz" if {"events", "meta"} <= names else None
    return None


def open_dataset(path: Path, layout: DatasetLayout) -> Dataset:
    """Read `meta` and look for the maps.

    Raises:
        BadFile: something is missing, damaged or does not fit together, or `meta` is a pickle that would run code.
    """
    if layout == "EV-IMO text":
        meta = meta_of_text_file(path / "meta.txt")
        maps: Maps = PictureMaps(path, meta.frames)
    elif layout == "EVIMO2 folder":
        info = Archive(path / "dataset_info.npz")
        meta = meta_of(_value(info), f"`meta` in {info.path}")
        maps = FolderMaps(path, meta.frames)
    else:
        archive = Archive(path)
        meta = meta_of(_value(archive), f"`meta` in {path}")
        maps = archived = ArchivedMaps(archive)
        if len(archived) != len(meta.frames):
            text = f"{path}: `depth` and `mask` hold {len(archived)} maps, `meta` {len(meta.frames)} frames"
            raise BadFile(text, fix="copy the file again from the dataset")
    first = is_first_version(meta.camera, maps.size, f"meta of {path}")
    if layout == "EV-IMO npz" and not first:
        layout = "EVIMO2 npz"
    return Dataset(path, layout, maps, meta, first)


def _value(archive: Archive) -> Any:
    if "meta" not in archive.names:
        raise BadFile(f"{archive.path} lacks `meta`", fix="copy the file again from the dataset")
    return archive.value("meta")


def parts_of(dataset: Dataset, paths: Paths) -> DatasetParts:
    """The recording's parts, its frames being those whose truth is known; a warning counts the others and says why.

    Raises:
        BadFile: none is, or a frame has maps and no pose of the camera.
    """
    entries = dataset.meta.frames
    placed = dataset.poses(entries)[1]
    mapped = np.array([dataset.maps.has(k) for k in range(len(entries))], np.bool_)
    if (posed := mapped & entries.without_cam).any():
        text = f"{dataset.where}['frames'][{int(posed.argmax())}] has maps, and lacks 'cam', the camera's pose"
        raise BadFile(text, fix="copy it again from the dataset")
    listed = {key: np.isfinite(poses).all(axis=(1, 2)) for key, poses in placed.items()}
    twice = mapped & ~np.append(True, np.diff(entries.times_us) > 0)[: len(entries)]
    exact = paths.motions(entries.times_us)
    known = np.isfinite(exact["ego"]).all(axis=1) & ~entries.broken
    for column, key in enumerate(paths.object_ids):
        known &= ~listed.get(key, np.zeros_like(known)) | np.isfinite(exact["velocities"][:, column]).all(axis=1)
    _say_left_out(
        dataset.path, len(entries), {"no maps": ~mapped, "another's time": twice, UNKNOWN: mapped & ~twice & ~known}
    )
    frames = np.flatnonzero(mapped & ~twice & known)
    if not len(frames):
        raise BadFile(f"{dataset.path} has no frame with maps and known motion", fix="evimo check says what is wrong")
    for column, key in enumerate(paths.object_ids):  # the very poses that the maps were rendered with
        if key in placed:
            own = placed[key][:, :3, 3]
            exact["positions"][:, column] = np.where(np.isfinite(own), own, exact["positions"][:, column])
            for name in ("positions", "velocities", "rotations"):
                exact[name][~listed[key], column] = np.nan
    cut = {name: values if name == "object_ids" else values[frames] for name, values in exact.items()}
    return DatasetParts(dataset.path, dataset.maps, frames, dataset.camera(), cut)


def _say_left_out(path: Path, count: int, why: dict[str, NDArray[np.bool_]]) -> None:
    """Warn of frames that are not used, with a count for each reason."""
    counts = {reason: int(np.count_nonzero(which)) for reason, which in why.items()}
    if left := sum(counts.values()):
        reasons = ", ".join(f"{number} with {reason}" for reason, number in counts.items() if number)
        warnings.warn(f"{path}: {left} of {count} frames are left out: {reasons}", EvimoWarning, stacklevel=4)
