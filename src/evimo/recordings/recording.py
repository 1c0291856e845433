"""A recording with truth: events, camera, and what really happened at the centre of each slice."""

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, NotFound
from evimo.formats.event_file import EventFile
from evimo.formats.npz_members import Archive
from evimo.geometry.camera import Camera
from evimo.recordings.facts import DAMAGED, FACTS, facts_of
from evimo.recordings.imu import Imu
from evimo.recordings.pose_track import PoseTrack
from evimo.recordings.stored_parts import ArchiveParts, Arrays, FolderParts, StoredParts
from evimo.recordings.truth import ObjectTruth, Truth

TRUTH_FILES = ("dataset_sim.npz", "dataset_clutter.npz")  # only our own folders have them
MOTIONS = ("times_us", "ego", "object_ids", "positions", "velocities", "rotations")
TRAJECTORY = ("trajectory_us", "trajectory_world_from_cam", "trajectory_cam_from_object")


class Recording:
    """One folder or file, opened lazily; made by `open_recording`.

    path:     the folder or file.
    camera:   of the sensor.
    times_us: (F,) int64, the instants whose truth is known, in the events' own clock.
    meta:     how it was made: set, seed, sensor settings, version.
    """

    def __init__(self, parts: StoredParts, camera: Camera, motions: Arrays, meta: dict[str, Any]) -> None:
        self.path, self.camera, self.meta = parts.path, camera, meta
        self.times_us: NDArray[np.int64] = motions["times_us"].astype(np.int64)
        self._parts, self._motions = parts, motions

    def __len__(self) -> int:
        return len(self.times_us)

    @cached_property
    def events(self) -> EventFile:
        """The events: packets in constant memory."""
        return self._parts.events()

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
        rows = arrays["t_us"].size
        if any(values.shape != ((rows,) if name == "t_us" else (rows, 3)) for name, values in arrays.items()):
            raise BadFile(f"IMU arrays of {self.path} do not fit together", fix=DAMAGED)
        return Imu(**arrays)

    @cached_property
    def poses(self) -> PoseTrack | None:
        """Where the camera and the objects are, at 200 Hz; None where the recording has no poses.

        Raises:
            BadFile: they do not fit together.
        """
        try:
            arrays = self._parts.motions(("object_ids", *TRAJECTORY))
        except BadFile:
            return None
        times_us, world_from_cam, placed = (arrays[name] for name in TRAJECTORY)
        ids = arrays["object_ids"]
        if world_from_cam.shape != (len(times_us), 4, 4) or placed.shape[::2] != (len(times_us), 4) or placed.ndim != 4:
            raise BadFile(f"poses of {self.path} do not fit together", fix=DAMAGED)
        # A scene may have movers that its truth never shows: they have poses, and no number here.
        return PoseTrack(times_us.astype(np.int64), world_from_cam, ids, placed[:, ids.astype(np.intp) - 1])

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
        motions = (self._motions[name][k] for name in ("positions", "velocities", "rotations"))
        objects = {
            int(id_): ObjectTruth(*moved)
            for id_, *moved in zip(self._motions["object_ids"], *motions, strict=True)
            if np.isfinite(moved).all()
        }
        return Truth(int(self.times_us[k]), depth_m, depth > 0, ids, clutter, self._motions["ego"][k], objects)

    def clutter_bodies(self, k: int) -> NDArray[np.uint8]:
        """Which static body drawn like the movers is seen in each pixel, (H, W); 0 is none."""
        return self._map("clutter", k)

    def _map(self, name: str, k: int) -> NDArray[Any]:
        values = self._parts.map(name, k)
        if values.shape != self.camera.size:
            raise BadFile(f"{name} {k} of {self.path} is {values.shape}, the sensor {self.camera.size}", fix=DAMAGED)
        return values


def knows_truth(path: Path) -> bool:
    """Whether `evimo simulate` has written this folder or .npz file, be it whole or damaged.

    Raises:
        BadFile: an .npz file in which nothing can be found.
    """
    if path.is_dir():
        return any((path / name).exists() for name in TRUTH_FILES)
    return path.suffix == ".npz" and path.exists() and FACTS in Archive(path).names


def open_recording(path: str | Path) -> Recording:
    """Open a recording with truth, as the simulator writes it: a folder, or an .npz file in EV-IMO's own layout.

    Raises:
        NotFound: no such folder or file.
        BadFile: it lacks a part, or a part is damaged; nothing in it is ever unpickled.
    """
    path = Path(path)
    if not path.exists():
        raise NotFound(f"no recording {path}", fix="what `evimo simulate` has written, a folder or an .npz file")
    information = facts_of(path)
    parts = FolderParts(path) if path.is_dir() else ArchiveParts(path)
    motions = parts.motions(MOTIONS)
    frames, bodies = len(motions["times_us"]), len(motions["object_ids"])
    shapes = {"ego": (frames, 6)} | dict.fromkeys(("positions", "velocities", "rotations"), (frames, bodies, 3))
    if any(motions[name].shape != shape for name, shape in shapes.items()):
        raise BadFile(f"exact motions (sim) of {path} do not fit together", fix=DAMAGED)
    try:
        stored: dict[str, Any] = dict(information["camera"])
        stored["distortion"] = tuple(stored["distortion"])
        camera = Camera(**stored)
    except (KeyError, TypeError) as error:
        raise BadFile(f"what {path} tells of itself (info.json, sim_facts) lacks the camera", fix=DAMAGED) from error
    return Recording(parts, camera, motions, information)
