"""Exact poses of a scene's camera and movers."""

import numpy as np
from numpy.typing import NDArray

from evimo.recordings.pose_track import PoseTrack
from evimo.scene.bodies import Scene
from evimo.scene.motion import Poses

F8 = NDArray[np.float64]


def scene_poses(scene: Scene, times_us: NDArray[np.int64]) -> PoseTrack:
    """Poses at times (M,); the world is the scene's own, z up; movers have the ids 1 to K."""
    time_s: F8 = np.asarray(times_us, np.float64) * 1e-6
    world_from_cam = _matrices(scene.camera.at(time_s))
    motions = [body.motion for body in scene.bodies if body.motion is not None]
    world_from_object = np.zeros((len(time_s), len(motions), 4, 4))
    for index, motion in enumerate(motions):
        world_from_object[:, index] = _matrices(motion.at(time_s))
    cam_from_object = np.linalg.inv(world_from_cam)[:, None] @ world_from_object
    ids = np.arange(1, len(motions) + 1, dtype=np.uint8)
    return PoseTrack(np.asarray(times_us, np.int64), world_from_cam, ids, cam_from_object)


def _matrices(poses: Poses) -> F8:
    """(T, 4, 4), the world from the body."""
    matrices = np.tile(np.eye(4), (len(poses.position), 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = poses.rotation, poses.position
    return matrices
