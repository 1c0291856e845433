"""Where the camera and the objects of a recording are at any time, how they move, and which of them move at all."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.geometry.rotations import inverse_poses
from evimo.geometry.trajectory import Motion, Trajectory, fit_trajectory
from evimo.recordings.pose_track import PoseTrack
from evimo.recordings.truth import MOVING_DEGPS, MOVING_MPS

F8 = NDArray[np.float64]
Arrays = dict[str, NDArray[np.generic]]

RESTS = 0.5  # of the speed from which a body moves: one that moves does so until it is slower than this
STALE = 4  # so many samples of exactly one place may be a body that was lost
STALE_M, STALE_RAD = 0.005, 0.02  # a step out of rest, from one sample to the next, that nothing makes
SAME = 1e-8  # of matrices that were printed alike


@dataclass(frozen=True, slots=True)
class Paths:
    """Splines of the camera and of every object in the world, and when each object moves.

    steps_us: (T,) int64. moving: id to (T,) bool, at these times.
    """

    camera: Trajectory
    objects: dict[int, Trajectory]
    steps_us: NDArray[np.int64]
    moving: dict[int, NDArray[np.bool_]]

    @property
    def object_ids(self) -> list[int]:
        """The objects, by number."""
        return sorted(self.objects)

    def poses(self, times_us: NDArray[np.int64]) -> PoseTrack:
        """Poses at times (M,), NaN where they are not known."""
        times_us = np.asarray(times_us, np.int64)
        camera = self.camera.at(times_us)
        world_from_cam = _known(camera.world_from_body, camera.valid)
        bodies = [self.objects[key].at(times_us) for key in self.object_ids]
        found = [_known(body.world_from_body, body.valid) for body in bodies]
        placed = np.stack(found, axis=1) if found else np.zeros((len(times_us), 0, 4, 4))
        cam_from_object = inverse_poses(world_from_cam)[:, None] @ placed
        return PoseTrack(times_us, world_from_cam, np.array(self.object_ids, np.uint8), cam_from_object)

    def motions(self, times_us: NDArray[np.int64]) -> Arrays:
        """Exact motions at times (F,) as recordings store them, NaN where not known, and `moving` (F, K) bool."""
        times_us = np.asarray(times_us, np.int64)
        camera = self.camera.at(times_us)
        shape = (len(times_us), len(self.objects))
        positions, velocities, rotations = np.full((3, *shape, 3), np.nan)
        moving = np.zeros(shape, np.bool_)
        cam_from_world = inverse_poses(camera.world_from_body)
        place = np.clip(np.searchsorted(self.steps_us, times_us, side="right") - 1, 0, None)
        for column, key in enumerate(self.object_ids):
            body = self.objects[key].at(times_us)
            known = body.valid & camera.valid
            cam_from_body = cam_from_world @ body.world_from_body
            positions[known, column] = cam_from_body[known, :3, 3]
            for values, part in ((velocities, body.twist[:, :3]), (rotations, body.twist[:, 3:])):
                values[known, column] = np.einsum("mij,mj->mi", cam_from_body[known, :3, :3], part[known])
            if len(self.steps_us):
                moving[:, column] = self.moving[key][place]
        return {
            "times_us": times_us,
            "ego": np.where(camera.valid[:, None], camera.twist, np.nan),
            "object_ids": np.array(self.object_ids, np.uint8),
            "positions": positions,
            "velocities": velocities,
            "rotations": rotations,
            "moving": moving,
        }

    def bad_samples(self) -> dict[str, int]:
        """How many samples were left out, by whose they are, where there are any."""
        whose = {"the camera": self.camera, **{f"object {key}": self.objects[key] for key in self.object_ids}}
        return {name: int(path.bad.sum()) for name, path in whose.items() if path.bad.any()}


def paths_of(times_us: NDArray[np.int64], world_from_cam: F8, cam_from_object: dict[int, F8]) -> Paths:
    """Fit the paths of a recording to its poses (N, 4, 4), NaN where one is not known.

    An object that was lost, and whose last pose the dataset repeats until it is found again, is not known meanwhile.
    """
    world_from_cam = np.asarray(world_from_cam, np.float64)
    camera = fit_trajectory(times_us, world_from_cam)
    objects: dict[int, Trajectory] = {}
    for key, placed in cam_from_object.items():
        world_from_object = world_from_cam @ placed
        world_from_object[stale(world_from_object)] = np.nan
        known = np.isfinite(world_from_object).all(axis=(1, 2))
        objects[key] = fit_trajectory(times_us[known], world_from_object[known])
    steps_us = np.unique(np.asarray(times_us, np.int64))  # rising, even where samples went back in time
    moving = {key: moving_of(path.at(steps_us)) for key, path in objects.items()}
    return Paths(camera, objects, steps_us, moving)


def moving_of(motion: Motion) -> NDArray[np.bool_]:
    """When a body moves (M,): from 3 cm/s or 10 degrees/s on, until it is slower than half of both."""
    speed = np.linalg.norm(motion.twist[:, :3], axis=1) / MOVING_MPS
    turning = np.linalg.norm(motion.twist[:, 3:], axis=1) / math.radians(MOVING_DEGPS)
    share = np.where(motion.valid, np.maximum(speed, turning), np.nan)
    clear = (share > 1) | (share < RESTS)
    last = np.maximum.accumulate(np.where(clear, np.arange(len(share)), -1))
    return np.where(last >= 0, (share > 1)[np.maximum(last, 0)], False)


def stale(world_from_object: F8) -> NDArray[np.bool_]:
    """Which samples (N,) repeat a pose exactly until a step that nothing makes: the object was lost there."""
    if len(world_from_object) < STALE:
        return np.zeros(len(world_from_object), np.bool_)
    step = np.abs(np.diff(world_from_object, axis=0))
    same = step.max(axis=(1, 2)) < SAME
    leaps = (step[:, :3, 3].max(axis=1) > STALE_M) | (step[:, :3, :3].max(axis=(1, 2)) > STALE_RAD)
    run = np.cumsum(np.append(True, ~same)) - 1
    sizes = np.bincount(run)
    first = np.cumsum(sizes) - sizes
    last = first + sizes - 1
    lost = (sizes >= STALE) & np.append(leaps, False)[last]
    # The first sample of a run is where the object was last seen.
    return lost[run] & (np.arange(len(run)) != first[run])


def _known(poses: F8, valid: NDArray[np.bool_]) -> F8:
    return np.where(valid[:, None, None], poses, np.nan)
