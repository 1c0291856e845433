"""A recording with truth: events, camera, and what really happened at the centre of each slice."""

import zipfile
import zlib
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, NotFound
from evimo.events.io.event_file import EventFile
from evimo.events.io.evimo2 import mapped, open_evimo2
from evimo.geometry.camera import Camera
from evimo.recordings.facts import DAMAGED, facts_of
from evimo.recordings.imu import IMU_ARRAYS, Imu
from evimo.recordings.truth import ObjectTruth, Truth

SIM_SHAPES = {"times_us": 1, "ego": 2, "object_ids": 1, "positions": 3, "velocities": 3, "rotations": 3}


class Recording:
    """One folder, opened lazily; made by `open_recording`.

    path:     the folder.
    camera:   of the sensor.
    times_us: (F,) int64, the instants whose truth is known, in the events' own clock.
    meta:     how it was made: set, seed, sensor settings, version.
    """

    def __init__(self, path: Path, camera: Camera, sim: dict[str, NDArray[Any]], meta: dict[str, Any]) -> None:
        self.path, self.camera, self.meta = path, camera, meta
        self.times_us: NDArray[np.int64] = sim["times_us"].astype(np.int64)
        self._sim = sim

    def __len__(self) -> int:
        return len(self.times_us)

    @cached_property
    def events(self) -> EventFile:
        """The events, memory-mapped: packets in constant memory."""
        return open_evimo2(self.path)

    @cached_property
    def event_ids(self) -> NDArray[np.uint8] | None:
        """What each event's pixel saw at the event's own time, (N,) memory-mapped, in the file's order; 0 is static.

        None where the recording has none.

        Raises:
            BadFile: they are damaged, or not as many as the events.
        """
        path, times = (self.path / f"dataset_events_{name}.npy" for name in ("id", "t"))
        if not path.exists():
            return None
        ids, events = mapped(path), len(mapped(times))
        if ids.dtype != np.uint8 or ids.shape != (events,):
            raise BadFile(f"{path.name} of {self.path} is {ids.dtype} {ids.shape} of {events:,} events", fix=DAMAGED)
        return ids

    @cached_property
    def imu(self) -> Imu | None:
        """Gyroscope and accelerometer; None where the recording has none.

        Raises:
            BadFile: they are damaged.
        """
        path = self.path / "dataset_imu.npz"
        if not path.exists():
            return None
        arrays = _arrays(path, IMU_ARRAYS)
        rows = arrays["t_us"].size
        if any(values.shape != ((rows,) if name == "t_us" else (rows, 3)) for name, values in arrays.items()):
            raise BadFile(f"dataset_imu.npz of {self.path} has arrays that do not fit together", fix=DAMAGED)
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
        motions = (self._sim[name][k] for name in ("positions", "velocities", "rotations"))
        objects = {
            int(id_): ObjectTruth(*moved)
            for id_, *moved in zip(self._sim["object_ids"], *motions, strict=True)
            if np.isfinite(moved).all()
        }
        return Truth(int(self.times_us[k]), depth_m, depth > 0, ids, clutter, self._sim["ego"][k], objects)

    def clutter_bodies(self, k: int) -> NDArray[np.uint8]:
        """Which static body drawn like the movers is seen in each pixel, (H, W); 0 is none."""
        return self._map("clutter", k)

    def _map(self, name: str, k: int) -> NDArray[Any]:
        key = f"{name}_{k:010d}"
        values = _arrays(self.path / f"dataset_{name}.npz", (key,))[key]
        if values.shape != self.camera.size:
            raise BadFile(f"{key} of {self.path} is {values.shape}, the sensor {self.camera.size}", fix=DAMAGED)
        return values


def open_recording(folder: str | Path) -> Recording:
    """Open a recording with truth, as the simulator writes it.

    Raises:
        NotFound: no such folder.
        BadFile: it lacks a part, or a part is damaged; nothing in it is ever unpickled.
    """
    path = Path(folder)
    if not path.is_dir():
        raise NotFound(f"no recording {path}", fix="a folder that `evimo simulate` has written")
    information = facts_of(path)
    sim = _arrays(path / "dataset_sim.npz", tuple(SIM_SHAPES))
    frames, bodies = len(sim["times_us"]), len(sim["object_ids"])
    shapes = {"ego": (frames, 6)} | dict.fromkeys(("positions", "velocities", "rotations"), (frames, bodies, 3))
    if any(sim[name].shape != shape for name, shape in shapes.items()):
        raise BadFile(f"dataset_sim.npz of {path} has arrays that do not fit together", fix=DAMAGED)
    try:
        stored: dict[str, Any] = dict(information["camera"])
        stored["distortion"] = tuple(stored["distortion"])
        camera = Camera(**stored)
    except (KeyError, TypeError) as error:
        raise BadFile(f"dataset_info.json of {path} lacks the camera", fix=DAMAGED) from error
    return Recording(path, camera, sim, information)


def _arrays(path: Path, names: tuple[str, ...]) -> dict[str, NDArray[Any]]:
    """Arrays of an npz file by name."""
    if not path.exists():
        raise BadFile(f"{path.parent} lacks {path.name}", fix=DAMAGED)
    try:
        with np.load(path, allow_pickle=False) as archive:
            return {name: archive[name] for name in names}
    except (ValueError, KeyError, OSError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise BadFile(f"{path} is damaged: {error}", fix=DAMAGED) from error
