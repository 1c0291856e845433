"""A recording with truth: events, camera, and what really happened at the centre of each slice."""

import hashlib
import json
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.arguments import path_of
from evimo.errors import BadFile, NotFound
from evimo.formats.event_file import EventFile
from evimo.geometry.camera import Camera
from evimo.recordings.carried_truth import carried
from evimo.recordings.datasets import open_dataset, parts_of
from evimo.recordings.evimo1_bag import open_bag
from evimo.recordings.facts import DAMAGED, facts_of
from evimo.recordings.imu import Imu
from evimo.recordings.layouts import layout_of
from evimo.recordings.paths import Paths, paths_of
from evimo.recordings.splits import place_of
from evimo.recordings.stored_parts import Arrays, StoredParts, own_parts
from evimo.recordings.truth import ObjectTruth, Truth
from evimo.writing import shown

MOTIONS = ("times_us", "ego", "object_ids", "positions", "velocities", "rotations")
TRAJECTORY = ("trajectory_us", "trajectory_world_from_cam", "trajectory_cam_from_object")
SAME_US = 1_000  # truth that is as near as this is the truth of an instant
TRAJECTORY_IDS = "trajectory_object_ids"
PREPARED = "prepared_v"
"""How the folder begins that `prepare` adds to a recording, and that changes nothing about it."""
REACH_US = 15_000  # from which truth is carried to another instant: more than half a period of 40 Hz with its jitter


class Recording:
    """One folder or file, opened lazily; made by `open_recording`.

    path:     the folder or file.
    camera:   of the sensor.
    times_us: (F,) int64, the instants whose truth is known, in the events' own clock.
    meta:     how it was made: set, seed, sensor settings, version; or its layout and its place in a dataset.
    """

    def __init__(
        self,
        parts: StoredParts,
        camera: Camera,
        motions: Arrays,
        meta: dict[str, Any],
        *,
        find_paths: Callable[[], Paths | None] = lambda: None,
    ) -> None:
        self.path, self.camera, self.meta = parts.path, camera, meta
        self.times_us: NDArray[np.int64] = motions["times_us"].astype(np.int64)
        self._parts, self._motions, self._find_paths = parts, motions, find_paths

    def __len__(self) -> int:
        return len(self.times_us)

    @cached_property
    def events(self) -> EventFile:
        """The events: packets in constant memory."""
        return self._parts.events()

    @cached_property
    def mark(self) -> str:
        """What tells this recording from others, and from itself once one of its files has changed.

        A hash of what it says of itself and of the names, sizes and times of change of its files: nothing is read. A
        copy that was given times of its own counts as another recording.
        """
        root = self.path
        found = root.rglob("*") if root.is_dir() else [root]
        own = {each.relative_to(root): each.stat() for each in shown(found, below=root) if each.is_file()}
        kept = {name: each for name, each in own.items() if not any(part.startswith(PREPARED) for part in name.parts)}
        files = sorted((name.as_posix(), each.st_size, each.st_mtime_ns) for name, each in kept.items())
        return hashlib.sha256(json.dumps([self.meta, files], sort_keys=True).encode()).hexdigest()

    def event_count(self) -> int:
        """How many events are stored, those that reading leaves out included."""
        return self._parts.event_count()

    @cached_property
    def event_ids(self) -> NDArray[np.uint8] | None:
        """What each event's pixel saw at the event's own time, (N,), in the file's order; 0 is static.

        Memory-mapped where the recording is a folder; None where it has none.

        Raises:
            BadFile: they are damaged, or not as many as the events.
        """
        ids = self._parts.event_ids()
        if ids is not None and (ids.dtype != np.uint8 or ids.shape != (self.event_count(),)):
            raise BadFile(f"ids of events of {self.path} are {ids.dtype} {ids.shape}, not one for each", fix=DAMAGED)
        return ids

    @cached_property
    def imu(self) -> Imu | None:
        """Gyroscope and accelerometer; None where the recording has none.

        Raises:
            BadFile: they are damaged.
        """
        arrays = self._parts.imu()
        if arrays is None:
            return None
        _check_numbers(arrays, self.path)
        rows = arrays["t_us"].size
        if any(values.shape != ((rows,) if name == "t_us" else (rows, 3)) for name, values in arrays.items()):
            raise BadFile(f"IMU arrays of {self.path} do not fit together", fix=DAMAGED)
        return Imu(**arrays)

    def truth(self, k: int) -> Truth:
        """Everything about the instant times_us[k].

        Raises:
            IndexError: there is no such instant. BadFile: a map is missing or damaged.
        """
        if not 0 <= k < len(self):
            raise IndexError(f"instant {k} of {len(self)}")
        depth, mask = self._map("depth", k), self._map("mask", k)
        depth_m = depth.astype(np.float32) * np.float32(1e-3)
        ids = (mask // 1000).astype(np.uint8)
        clutter = self._map("clutter", k) > 0
        objects = objects_at(self._motions, k)
        return Truth(int(self.times_us[k]), depth_m, depth > 0, ids, clutter, self._motions["ego"][k], objects)

    def truth_at(self, t_us: int) -> Truth | None:
        """Everything about an instant at or near those of `times_us`; None where nothing is known.

        Maps of an instant that is up to 15 ms away are carried along the poses of the camera and the objects.

        Raises:
            BadFile: a map is missing or damaged.
        """
        if not len(self):
            return None
        k = int(np.argmin(np.abs(self.times_us - t_us)))
        away_us = abs(int(self.times_us[k]) - t_us)
        if away_us <= SAME_US:
            return self.truth(k)
        if away_us > REACH_US or self.paths is None:
            return None
        return carried(self.truth(k), t_us, self.paths, self.camera)

    @cached_property
    def paths(self) -> Paths | None:
        """Where the camera and the objects are at any time, and how they move; None where no poses are stored.

        Raises:
            BadFile: they are damaged.
        """
        return self._find_paths()

    def clutter_bodies(self, k: int) -> NDArray[np.uint8]:
        """Which static body drawn like the movers is seen in each pixel, (H, W); 0 is none."""
        return self._map("clutter", k)

    def _map(self, name: str, k: int) -> NDArray[Any]:
        values = self._parts.map(name, k)
        _check_numbers({name: values}, self.path)
        if values.shape != self.camera.size:
            raise BadFile(f"{name} {k} of {self.path} is {values.shape}, the sensor {self.camera.size}", fix=DAMAGED)
        return values


def objects_at(motions: Arrays, k: int) -> dict[int, ObjectTruth]:
    """The objects that exist at an instant, by number."""
    each = zip(motions["object_ids"], *(motions[name][k] for name in MOTIONS[3:]), strict=True)
    settled = motions["moving"][k] if "moving" in motions else [None] * len(motions["object_ids"])
    return {
        int(id_): ObjectTruth(*moved, settled=None if moves is None else bool(moves))
        for (id_, *moved), moves in zip(each, settled, strict=True)
        if np.isfinite(moved).all()
    }


def open_recording(path: str | Path) -> Recording:
    """Open a recording with truth: one of EV-IMO or EVIMO2 in any of their layouts, or one that this package wrote.

    Raises:
        NotFound: no such folder or file.
        BadFile: it lacks a part, or a part is damaged; nothing in it is ever unpickled.
    """
    path = path_of(path, "a recording")
    if not path.exists():
        raise NotFound(f"no recording {path}", fix="a recording of EV-IMO or EVIMO2, or of `evimo simulate`")
    layout = layout_of(path)
    if layout in ("folder", "archive", "hdf5"):
        return _own(path)
    if layout == "EV-IMO bag":
        parts, paths = open_bag(path)
    else:
        dataset = open_dataset(path, layout)
        layout, paths = dataset.layout, dataset.paths()
        parts = parts_of(dataset, paths)
    meta = {"layout": layout, **place_of(path).facts()}
    return Recording(parts, parts.camera, parts.exact, meta, find_paths=lambda: paths)


def _own(path: Path) -> Recording:
    """A recording that this package wrote."""
    information = facts_of(path)
    parts = own_parts(path)
    motions = parts.motions(MOTIONS)
    with suppress(BadFile):  # where speed alone tells what moves, there is none
        motions |= parts.motions(("moving",))
    _check_numbers(motions, path)
    if motions["times_us"].ndim != 1 or motions["object_ids"].ndim != 1:
        raise BadFile(f"exact motions (sim) of {path} do not fit together", fix=DAMAGED)
    frames, bodies = len(motions["times_us"]), len(motions["object_ids"])
    shapes = {"ego": (frames, 6)} | dict.fromkeys(("positions", "velocities", "rotations"), (frames, bodies, 3))
    shapes |= {"moving": (frames, bodies)} if "moving" in motions else {}
    if any(motions[name].shape != shape for name, shape in shapes.items()):
        raise BadFile(f"exact motions (sim) of {path} do not fit together", fix=DAMAGED)
    try:
        stored: dict[str, Any] = dict(information["camera"])
        stored["distortion"] = tuple(stored["distortion"])
        camera = Camera(**stored)
    except (KeyError, TypeError) as error:
        raise BadFile(f"what {path} tells of itself (info.json, sim_facts) lacks the camera", fix=DAMAGED) from error
    return Recording(parts, camera, motions, information, find_paths=lambda: _stored_paths(parts))


def _check_numbers(arrays: Arrays, path: Path) -> None:
    """Make sure that these are arrays of numbers.

    Raises:
        BadFile: one is something else.
    """
    for name, values in arrays.items():
        if np.asarray(values).dtype.kind not in "biuf":  # HDF5 may give bytes or a text
            raise BadFile(f"`{name}` of {path} is no array of numbers", fix=DAMAGED)


def _stored_paths(parts: StoredParts) -> Paths | None:
    """Splines of the poses at 200 Hz that a recording of this package holds; None where it was written without."""
    try:
        arrays = parts.motions(TRAJECTORY)
    except BadFile:
        return None
    _check_numbers(arrays, parts.path)
    placed = arrays["trajectory_cam_from_object"]
    try:
        ids = [int(key) for key in parts.motions((TRAJECTORY_IDS,))[TRAJECTORY_IDS]]
    except BadFile:  # written before version 0.2, when objects were numbered from 1
        ids = list(range(1, placed.shape[1] + 1))
    frames = len(arrays["trajectory_us"])
    if arrays["trajectory_world_from_cam"].shape != (frames, 4, 4) or placed.shape != (frames, len(ids), 4, 4):
        raise BadFile(f"poses of {parts.path} do not fit together", fix=DAMAGED)
    columns = {key: placed[:, column] for column, key in enumerate(ids)}
    return paths_of(arrays["trajectory_us"], arrays["trajectory_world_from_cam"], columns)
