"""Poses in the words of EV-IMO and EVIMO2: translation, fixed-axis angles and quaternion under their names."""

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from evimo.geometry.rotations import angles_of_matrices, quaternions_of_matrices
from evimo.recordings.pose_track import PoseTrack

F8 = NDArray[np.float64]

DIGITS = 9  # differences at 200 Hz are then right to 1e-7 m/s
WORDED = 200  # poses at a time
TRAJECTORY_ID = 2**64 - 1  # what the datasets have there
# EV-IMO's first version: x up, y left, z backward.
V1_FROM_CAM = np.array([[0.0, -1, 0, 0], [-1, 0, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]])


def in_v1_axes(track: PoseTrack) -> PoseTrack:
    """The same poses where the camera's axes, and so the axes of its world, are those of EV-IMO's first version.

    An object keeps its own axes, which are arbitrary there too.
    """
    world_from_cam = V1_FROM_CAM @ track.world_from_cam @ V1_FROM_CAM.T
    return replace(track, world_from_cam=world_from_cam, cam_from_object=V1_FROM_CAM @ track.cam_from_object)


def in_own_axes(world_from_cam: F8, cam_from_object: dict[int, F8]) -> tuple[F8, dict[int, F8]]:
    """Poses (N, 4, 4) of EV-IMO's first version in this package's axes: the way back from `in_v1_axes`."""
    placed = {key: V1_FROM_CAM.T @ poses for key, poses in cam_from_object.items()}
    return V1_FROM_CAM.T @ world_from_cam @ V1_FROM_CAM, placed


class PoseWords(Protocol):
    """Entries of poses that follow `first` others."""

    def __call__(self, track: PoseTrack, *, first: int = 0) -> list[dict[str, Any]]:
        """One entry per instant."""
        ...


def frame_words(track: PoseTrack, *, first: int = 0) -> list[dict[str, Any]]:
    """One entry of `frames` per instant; the world's origin should be the camera at time zero."""
    entries = enumerate(_entries(track), first)
    return [{"id": k, **entry, "gt_frame": f"depth_mask_{k}.png"} for k, entry in entries]


def trajectory_words(track: PoseTrack, *, first: int = 0) -> list[dict[str, Any]]:
    """One entry of `full_trajectory` per instant, all of one number."""
    return [{"id": TRAJECTORY_ID, **entry} for entry in _entries(track)]


def listed(
    track: PoseTrack, words: PoseWords, *, axes: Callable[[PoseTrack], PoseTrack] | None = None
) -> Iterator[str]:
    """The JSON list of all entries, some at a time: as Python objects they take fifty times the memory of their poses.

    axes: what the poses are turned into before.
    """
    yield "["
    for first in range(0, len(track.times_us), WORDED):
        part = track.part(first, first + WORDED)
        yield (",\n" if first else "") + json.dumps(words(axes(part) if axes else part, first=first))[1:-1]
    yield "]"


def _entries(track: PoseTrack) -> list[dict[str, Any]]:
    """Time, camera and objects of each instant: `ts`, `cam`, and each object under its number while it is tracked."""
    names = ["cam", *map(str, track.object_ids.tolist())]
    poses = np.concatenate((track.world_from_cam[:, None], track.cam_from_object), axis=1)
    known = np.asarray(np.isfinite(poses).all(axis=(2, 3)), np.bool_)
    words = _words(np.where(known[..., None, None], poses, np.eye(4)).reshape(-1, 4, 4))
    entries: list[dict[str, Any]] = []
    for k, t_us in enumerate(track.times_us.tolist()):
        time_s = round(t_us * 1e-6, 6)
        mine = zip(names, words[k * len(names) : (k + 1) * len(names)], known[k], strict=True)
        bodies = {name: {"pos": pose, "ts": time_s} for name, pose, tracked in mine if tracked}
        entries.append({"ts": time_s, **bodies})
    return entries


def _words(poses: F8) -> list[dict[str, dict[str, float]]]:
    """Each of (N, 4, 4) as {t: x y z, rpy: r p y, q: w x y z}, m and rad."""
    if not len(poses):
        return []
    angles, quaternions = angles_of_matrices(poses[:, :3, :3]), quaternions_of_matrices(poses[:, :3, :3])
    parts = (("t", "xyz", poses[:, :3, 3]), ("rpy", "rpy", angles), ("q", "wxyz", quaternions))
    named = [(name, letters, np.round(values, DIGITS).tolist()) for name, letters, values in parts]
    return [
        {name: dict(zip(letters, rows[k], strict=True)) for name, letters, rows in named} for k in range(len(poses))
    ]
