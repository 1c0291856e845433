"""Truth of an instant between two frames: the maps of the nearest one, carried along the poses."""

import numpy as np
from numpy.typing import NDArray

from evimo.geometry.camera import Camera
from evimo.geometry.rotations import inverse_poses
from evimo.recordings.paths import Paths
from evimo.recordings.truth import ObjectTruth, Truth

F8 = NDArray[np.float64]
ENCLOSED = 5  # of eight neighbours that hold something: a hole between points, which is filled from them
NEIGHBOURS = ((0, -1), (0, 1), (-1, 0), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1))


def carried(truth: Truth, t_us: int, paths: Paths, camera: Camera) -> Truth | None:
    """Move every pixel of known depth with the pose of what it shows, to another instant; None where it is not known.

    The nearest point wins a pixel. Pixels of objects without depth stay where they are, as static ones do that have
    none: nothing is known of how they move.
    """
    both = np.array([truth.t_us, t_us])
    poses, motions = paths.poses(both), paths.motions(both)
    static = inverse_poses(poses.world_from_cam[1]) @ poses.world_from_cam[0]
    if not np.isfinite(static).all():
        return None
    steps = {0: static}
    for column, key in enumerate(paths.object_ids):
        step = poses.cam_from_object[1, column] @ inverse_poses(poses.cam_from_object[0, column])
        if np.isfinite(step).all():
            steps[key] = step
    seen = np.unique(truth.ids).tolist()
    if any(key not in steps for key in seen):
        return None
    depth, source = _splatted(truth, {key: steps[key] for key in seen}, camera)
    held = source >= 0
    at = np.maximum(source, 0)
    # Where no point comes to lie, only pixels whose depth was never known stay as they are.
    stays = ~held & ~truth.valid & (truth.ids > 0)
    ids = np.where(held, truth.ids.ravel()[at], np.where(stays, truth.ids, 0)).astype(np.uint8)
    clutter = np.where(held, truth.clutter.ravel()[at], False)
    objects = _objects(motions)
    return Truth(int(t_us), np.where(held, depth, 0).astype(np.float32), held, ids, clutter, motions["ego"][1], objects)


def _objects(motions: dict[str, NDArray[np.generic]]) -> dict[int, ObjectTruth]:
    """The objects at the second of two instants."""
    found: dict[int, ObjectTruth] = {}
    for column, key in enumerate(motions["object_ids"].tolist()):
        moved = [np.asarray(motions[name][1, column], np.float64) for name in ("positions", "velocities", "rotations")]
        if np.isfinite(moved).all():
            found[int(key)] = ObjectTruth(*moved, settled=bool(motions["moving"][1, column]))
    return found


def _splatted(truth: Truth, steps: dict[int, F8], camera: Camera) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Depth (H, W) after each pixel's step, and which pixel came to lie there; -1 is none."""
    height, width = camera.size
    chosen = np.flatnonzero(truth.valid)
    row, column = np.divmod(chosen, width)
    straight, known = camera.normalised(np.stack((column, row), axis=1).astype(np.float64))
    z = truth.depth.ravel()[chosen].astype(np.float64)
    points = np.concatenate((straight * z[:, None], z[:, None]), axis=1)
    ids = truth.ids.ravel()[chosen]
    for key, step in steps.items():
        mine = ids == key
        points[mine] = points[mine] @ step[:3, :3].T + step[:3, 3]
    ahead = known & (points[:, 2] > 1e-3)
    xy = points[:, :2] / np.where(ahead, points[:, 2], 1)[:, None]
    to = np.rint(camera.project(xy)).astype(np.int64)
    inside = ahead & camera.sees(xy) & (to >= 0).all(axis=1) & (to[:, 0] < width) & (to[:, 1] < height)
    order = np.flatnonzero(inside)
    order = order[np.argsort(-points[order, 2], kind="stable")]  # the nearest is written last
    place = to[order, 1] * width + to[order, 0]
    depth, source = np.zeros(height * width, np.float32), np.full(height * width, -1, np.int64)
    depth[place], source[place] = points[order, 2], chosen[order]
    return _filled(depth.reshape(height, width), source.reshape(height, width))


def _filled(depth: NDArray[np.float32], source: NDArray[np.int64]) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """The same with pixels that are enclosed by others filled from a neighbour, as where a surface comes nearer."""
    padded, near = np.pad(source, 1, constant_values=-1), np.pad(depth, 1)
    height, width = source.shape
    views = [(slice(1 + dy, 1 + dy + height), slice(1 + dx, 1 + dx + width)) for dy, dx in NEIGHBOURS]
    holes = (source < 0) & (sum((padded[view] >= 0).astype(np.int8) for view in views) >= ENCLOSED)
    depth, source = depth.copy(), source.copy()
    for view in reversed(views):
        taken = holes & (padded[view] >= 0)
        depth[taken], source[taken] = near[view][taken], padded[view][taken]
    return depth, source
