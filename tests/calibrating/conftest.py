"""A rig and a wand that move in known ways, as motion capture and a camera with a clock of its own see them."""

from dataclasses import dataclass
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evimo.calibrating.rigid import inverse, pose
from evimo.calibrating.sightings import Mocap
from evimo.geometry.camera import Camera
from evimo.geometry.trajectory import fit_trajectory

LENS = (-0.30, 0.09, 0.001, -0.0005)
CAMERA = Camera(258.0, 257.0, 176.0, 127.0, 260, 346, LENS)
RIG_FROM_CAM = pose(Rotation.from_euler("xyz", (95, 4, -88), degrees=True).as_matrix(), np.array((0.11, -0.04, 0.03)))
BODY_FROM_WAND = pose(Rotation.from_euler("xyz", (10, -70, 33), degrees=True).as_matrix(), np.array((0.02, 0.01, 0.05)))
OFFSET_US = 12_340.0
LIGHTS = np.array(((0, -0.15, 0), (0, 0, 0), (0, 0.075, 0), (0.12, 0, 0), (0.24, 0, 0)))  # a T
SECONDS = 16.0


def rotations(turn):
    return Rotation.from_rotvec(turn).as_matrix()


def world_from_rig(t_s):
    """A hand that holds the camera nearly still."""
    place = np.stack((0.3 * np.sin(0.5 * t_s), 0.1 * np.cos(0.9 * t_s), 1.2 + 0.05 * np.sin(1.3 * t_s)), axis=-1)
    turn = np.stack((0.1 * np.sin(0.7 * t_s), 0.1 * np.cos(0.4 * t_s), 0.2 * np.sin(0.3 * t_s)), axis=-1)
    return pose(rotations(turn), place)


def world_from_wand(t_s):
    """Waved all over the field of view at several distances: chosen in camera axes."""
    across, down = 0.55 * np.sin(1.9 * t_s), 0.4 * np.sin(2.7 * t_s + 0.5)
    far = 0.9 + 0.4 * np.sin(1.1 * t_s)
    place = np.stack((across * far, down * far, far), axis=-1)
    turn = np.stack((0.6 * np.sin(1.3 * t_s), 0.6 * np.cos(1.7 * t_s), 1.5 * np.sin(0.8 * t_s)), axis=-1)
    cam_from_lights = pose(rotations(turn), place)
    return world_from_rig(t_s) @ RIG_FROM_CAM @ cam_from_lights @ inverse(BODY_FROM_WAND)


def cam_from_wand(times_us):
    """Where the wand's lights are in front of the camera at times of the camera's clock."""
    t_s = (times_us - OFFSET_US) / 1e6
    return inverse(RIG_FROM_CAM) @ inverse(world_from_rig(t_s)) @ world_from_wand(t_s) @ BODY_FROM_WAND


def opencv_pixels(points, camera=CAMERA):
    """Points (N, 3) in camera axes to pixels by OpenCV, another road than ours."""
    matrix = np.array(((camera.fx, 0, camera.cx), (0, camera.fy, camera.cy), (0, 0, 1)))
    return cv2.projectPoints(points[:, None], np.zeros(3), np.zeros(3), matrix, np.array(camera.distortion))[0][:, 0]


@dataclass(frozen=True)
class Noise:
    position_m: float = 1e-4
    turn_rad: float = 3e-4
    dropped: float = 0.05
    px: float = 0.2
    missed: float = 0.1
    strangers: int = 2


def tracked(path, rng, noise=Noise(), seconds=SECONDS):
    """What 200 Hz motion capture makes of a path, fitted: noisy, with samples dropped and a few that jump."""
    t_s = np.arange(-1.0, seconds + 1.0, 0.005)
    poses = path(t_s)
    poses[:, :3, 3] += rng.normal(0, noise.position_m, (len(t_s), 3))
    poses[:, :3, :3] = poses[:, :3, :3] @ rotations(rng.normal(0, noise.turn_rad, (len(t_s), 3)))
    poses[rng.integers(0, len(t_s), 4), :3, 3] += 0.3
    kept = rng.random(len(t_s)) >= noise.dropped
    trajectory = fit_trajectory(np.rint(1e6 * t_s[kept]).astype(np.int64), poses[kept])

    def at(times_us):
        motion = trajectory.at(np.rint(times_us).astype(np.int64))
        return motion.world_from_body, motion.valid

    return at


def mocap_of(rng, noise=Noise(), seconds=SECONDS):
    return Mocap(tracked(world_from_rig, rng, noise, seconds), tracked(world_from_wand, rng, noise, seconds))


def spots_of_wand(rng, times_us, noise=Noise()):
    """Bright spots in images at times of the camera's clock, in any order, with strangers among them."""
    spots = []
    for each in cam_from_wand(times_us):
        px = opencv_pixels(LIGHTS @ each[:3, :3].T + each[:3, 3]) + rng.normal(0, noise.px, (len(LIGHTS), 2))
        inside = ((px >= 0) & (px <= (CAMERA.width - 1, CAMERA.height - 1))).all(axis=1)
        px = px[inside & (rng.random(len(px)) >= noise.missed)]
        others = rng.uniform((0, 0), (CAMERA.width, CAMERA.height), (rng.integers(0, noise.strangers + 1), 2))
        spots.append(rng.permutation(np.concatenate((px, others))))
    return spots


@pytest.fixture
def known():
    """The known rig: its constants, its motions, and what mocap and the camera make of them."""
    return SimpleNamespace(
        camera=CAMERA,
        rig_from_cam=RIG_FROM_CAM,
        body_from_wand=BODY_FROM_WAND,
        offset_us=OFFSET_US,
        lights=LIGHTS,
        mocap=mocap_of,
        spots=spots_of_wand,
        world_from_rig=world_from_rig,
        world_from_wand=world_from_wand,
        cam_from_wand=cam_from_wand,
        pixels=opencv_pixels,
        rotations=rotations,
        noise=Noise,
    )
