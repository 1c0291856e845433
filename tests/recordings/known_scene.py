"""A scene that is written down as formulas: a camera, two boards that move and one that rests, seen by ray casting."""

import numpy as np
from scipy.spatial.transform import Rotation

from evimo.events.events import Events
from evimo.geometry.camera import Camera
from evimo.recordings.pose_track import PoseTrack
from evimo.recordings.truth import ObjectTruth, Truth

CAMERA = Camera(70.0, 72.0, 43.0, 25.5, 60, 80, (-0.1, 0.02, 0.004, -0.003))
HALF_M = (0.22, 0.16)  # of a board's sides
SPIN = {1: (0.3, 1.1, -0.4), 2: (-0.6, 0.2, 0.5), 3: (0.0, 0.0, 0.0)}
PLACE = {1: (-0.25, 0.0, 1.0), 2: (0.3, 0.12, 1.3), 3: (0.1, -0.35, 1.6)}
SPEED = {1: (0.25, 0.1, -0.1), 2: (-0.2, -0.1, 0.15), 3: (0.0, 0.0, 0.0)}
EGO_SPIN, EGO_SPEED = (0.1, -0.15, 0.2), (0.08, 0.03, 0.1)


def screw(times_us, spin, place, speed):
    t = np.asarray(times_us)[:, None] * 1e-6
    poses = np.tile(np.eye(4), (len(t), 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(t * spin).as_matrix()
    poses[:, :3, 3] = place + t * speed
    return poses


def world_from_cam(times_us):
    return screw(times_us, EGO_SPIN, (0.0, 0.0, 0.0), EGO_SPEED)


def poses(times_us, ids=(1, 2, 3)):
    """Where everything is; the world is the camera at time zero."""
    camera = world_from_cam(times_us)
    bodies = [np.linalg.inv(camera) @ screw(times_us, SPIN[k], PLACE[k], SPEED[k]) for k in (1, 2, 3)]
    return PoseTrack(np.asarray(times_us, np.int64), camera, np.array(ids, np.uint8), np.stack(bodies, axis=1))


def truth(t_us, ids=(1, 2, 3), camera=CAMERA):
    """What is seen, by meeting every pixel's ray with the planes of the boards; depth is known on boards only."""
    straight, _ = camera.normalised(camera.pixels())
    rays = np.concatenate((straight, np.ones((*camera.size, 1))), axis=-1)
    depth, seen = np.full(camera.size, np.inf), np.zeros(camera.size, np.uint8)
    track = poses([t_us])
    objects = {}
    for column, id_ in enumerate(ids):
        placed, number = track.cam_from_object[0, column], column + 1
        rotation, origin = placed[:3, :3], placed[:3, 3]
        z = (rotation[:, 2] @ origin) / (rays @ rotation[:, 2])
        local = (rays * z[..., None] - origin) @ rotation
        hit = (z > 0) & (np.abs(local[..., 0]) < HALF_M[0]) & (np.abs(local[..., 1]) < HALF_M[1]) & (z < depth)
        depth[hit], seen[hit] = z[hit], id_
        turn = track.world_from_cam[0, :3, :3].T
        objects[id_] = ObjectTruth(origin, turn @ SPEED[number], turn @ SPIN[number])
    valid = seen > 0
    ego = np.concatenate((track.world_from_cam[0, :3, :3].T @ EGO_SPEED, EGO_SPIN))
    nothing = np.zeros(camera.size, np.bool_)
    return Truth(int(t_us), np.where(valid, depth, 0).astype(np.float32), valid, seen, nothing, ego, objects)


def events(start_us, stop_us, seed=0, number=4000):
    rng = np.random.default_rng((seed, start_us))
    t = np.sort(rng.integers(start_us, stop_us, number))
    x, y = rng.integers(0, 80, number).astype(np.uint16), rng.integers(0, 60, number).astype(np.uint16)
    return Events(x, y, t, rng.choice([-1, 1], number).astype(np.int8))
