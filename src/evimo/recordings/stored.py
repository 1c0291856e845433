"""What every layout that is written stores alike: maps, exact motions and poses, zip members without a clock."""

import io
import zipfile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.events.events import Events
from evimo.events.slices import SLICE_US
from evimo.recordings.pose_track import PoseSource, PoseTrack
from evimo.recordings.truth import Truth

Arrays = dict[str, NDArray[Any]]

ZIP_DATE = (1980, 1, 1, 0, 0, 0)  # not the clock's: the same recording gives the same bytes
TRAJECTORY_US = 5_000  # between poses: the 200 Hz of motion capture


def stored_maps(truth: Truth, clutter_bodies: NDArray[np.uint8] | None = None) -> Arrays:
    """Maps (H, W) in the datasets' units: `depth` uint16 mm, 0 unknown; `mask` uint16 1000 x id; `clutter` uint8."""
    depth = np.where(truth.valid, np.rint(truth.depth * 1000), 0).clip(0, 65535).astype(np.uint16)
    bodies = truth.clutter.astype(np.uint8) if clutter_bodies is None else clutter_bodies
    return {"depth": depth, "mask": truth.ids.astype(np.uint16) * 1000, "clutter": bodies}


def checked_ids(event_ids: NDArray[np.uint8], events: Events) -> NDArray[np.uint8]:
    """Ids, one for each event."""
    if len(event_ids) != len(events):
        raise ValueError(f"{len(event_ids)} ids of {len(events)} events")
    return np.ascontiguousarray(event_ids, np.uint8)


def without_maps(truth: Truth) -> Truth:
    """The motions of a truth: small enough to keep for a whole recording."""
    nothing = np.zeros((0, 0))
    return Truth(truth.t_us, nothing, nothing, nothing, nothing, truth.ego, truth.objects)  # type: ignore[arg-type]


def exact_motions(truths: list[Truth]) -> Arrays:
    """Instants and motions: `times_us` (F,), `ego` (F, 6), `object_ids` (K,), and `positions`, `velocities`,
    `rotations` (F, K, 3), nan where an object does not exist; camera axes, m, m/s, rad/s; and `moving` (F, K) where
    that was told from whole paths.
    """
    times = np.array([truth.t_us for truth in truths], np.int64)
    ids = sorted({id_ for truth in truths for id_ in truth.objects})
    motions = np.full((3, len(times), len(ids), 3), np.nan)
    for frame, truth in enumerate(truths):
        for id_, moved in truth.objects.items():
            motions[:, frame, ids.index(id_)] = moved.position, moved.velocity, moved.rotation
    ego = np.array([truth.ego for truth in truths]).reshape(-1, 6)
    arrays: Arrays = {"times_us": times, "ego": ego, "object_ids": np.array(ids, np.uint8)}
    settled = [
        (frame, id_, moved.settled) for frame, truth in enumerate(truths) for id_, moved in truth.objects.items()
    ]
    if any(moves is not None for _, _, moves in settled):
        arrays["moving"] = np.zeros((len(times), len(ids)), np.bool_)
        for frame, id_, moves in settled:
            arrays["moving"][frame, ids.index(id_)] = bool(moves)
    return arrays | dict(zip(("positions", "velocities", "rotations"), motions, strict=True))


def tracks(poses: PoseSource, times_us: NDArray[np.int64]) -> tuple[PoseTrack, PoseTrack]:
    """Poses at the instants of truth (F,), and every 5 ms from the first one's slice to the end of the last one's."""
    start_us, stop_us = (int(times_us[at]) // SLICE_US * SLICE_US for at in (0, -1)) if len(times_us) else (0, 0)
    stop_us += SLICE_US if len(times_us) else 0
    return poses(times_us), poses(np.arange(start_us, stop_us + 1, TRAJECTORY_US, dtype=np.int64))


def exact_poses(frames: PoseTrack, trajectory: PoseTrack) -> Arrays:
    """The poses as arrays: `world_from_cam` (F, 4, 4), `cam_from_object` (F, K, 4, 4), and the same at 200 Hz."""
    return {
        "world_from_cam": frames.world_from_cam,
        "cam_from_object": frames.cam_from_object,
        "trajectory_us": trajectory.times_us,
        "trajectory_object_ids": trajectory.object_ids,
        "trajectory_world_from_cam": trajectory.world_from_cam,
        "trajectory_cam_from_object": trajectory.cam_from_object,
    }


def save_arrays(archive: zipfile.ZipFile, arrays: Arrays) -> None:
    """Add arrays to a zip archive as .npy members; nothing is ever pickled."""
    for name, values in arrays.items():
        with archive.open(member(name), "w") as file:
            np.lib.format.write_array(file, values, allow_pickle=False)


def save_maps(archive: zipfile.ZipFile, maps: Arrays) -> None:
    """Add maps to a zip archive as .npy members, packed fast: a tenth larger, in an eighth of the time."""
    for name, values in maps.items():
        file = io.BytesIO()
        np.lib.format.write_array(file, values, allow_pickle=False)
        archive.writestr(member(name), file.getbuffer(), zipfile.ZIP_DEFLATED, compresslevel=1)


def member(name: str) -> zipfile.ZipInfo:
    """A compressed .npy member without the time of day."""
    info = zipfile.ZipInfo(f"{name}.npy", ZIP_DATE)
    info.compress_type = zipfile.ZIP_DEFLATED
    return info
