"""Fragments of a scanned room put together: ICP from where motion capture says that the scanner was."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.calibrating.rigid import angle_between, fit_rigid, moved

F8 = NDArray[np.float64]

PASSES = 3  # in each, every fragment is aligned with all others
REACH_M = (0.10, 0.05, 0.03)  # of pairs of points, in each pass
FARTHEST_M, FARTHEST_RAD = 0.25, np.radians(15)  # from the tracked pose: farther is another wall
FEWEST_PAIRS = 200
LEVER_M = 1.0  # how far from a scanner its rotation counts, where the world of motion capture is kept


@dataclass(frozen=True, slots=True)
class AlignedRoom:
    """Fragments in one world.

    world_from_scan: (F, 4, 4).
    moved_m, turned_rad: (F,), from the tracked poses.
    aligned:         (F,) bool; the others had too few points in common, and stay where they were tracked.
    before_m, after_m: median distance from a point to its nearest in other fragments, over those that overlap.
    """

    world_from_scan: F8
    moved_m: F8
    turned_rad: F8
    aligned: NDArray[np.bool_]
    before_m: float
    after_m: float


def align_fragments(
    fragments: Sequence[F8], tracked: F8, *, spacing_m: float, advance: Callable[[], None] = lambda: None
) -> AlignedRoom:
    """Poses of fragments that fit each other, in the world of motion capture.

    Each fragment is aligned with all others by generalised ICP, several times in turn. What all have in common stays
    where motion capture has it, on average.

    Args:
        fragments: points (N, 3) of each, m, on the scanner's axes.
        tracked: (F, 4, 4), world_from_scan by motion capture: within a few cm and degrees.
        spacing_m: fragments are thinned to this.
        advance: called for each fragment in each pass.
    """
    import small_gicp

    clouds = [small_gicp.preprocess_points(points, downsampling_resolution=spacing_m)[0] for points in fragments]
    thin = [np.asarray(cloud.points(), np.float64)[:, :3] for cloud in clouds]
    now = tracked.copy()
    aligned = np.zeros(len(thin), np.bool_)
    for reach_m in REACH_M:
        for number, cloud in enumerate(clouds):
            advance()
            others = [moved(now[at], points) for at, points in enumerate(thin) if at != number]
            if not others:
                continue
            target, tree = small_gicp.preprocess_points(np.concatenate(others), downsampling_resolution=spacing_m)
            found = small_gicp.align(
                target, cloud, tree, now[number], max_correspondence_distance=reach_m, max_iterations=50,
                translation_epsilon=1e-5, rotation_epsilon=1e-5,
            )  # fmt: skip
            pose = np.asarray(found.T_target_source, np.float64)
            near = np.linalg.norm(pose[:3, 3] - tracked[number, :3, 3]) < FARTHEST_M
            near &= float(angle_between(pose, tracked[number])) < FARTHEST_RAD
            if found.num_inliers >= FEWEST_PAIRS and near:
                now[number], aligned[number] = pose, True
    now = _kept_in_world(now, tracked)
    shift = np.linalg.norm(now[:, :3, 3] - tracked[:, :3, 3], axis=1)
    gaps = (_gap(thin, poses, REACH_M[0]) for poses in (tracked, now))
    return AlignedRoom(now, shift, angle_between(now, tracked), aligned, *gaps)


def _kept_in_world(now: F8, tracked: F8) -> F8:
    """All poses moved together so that they lie on the tracked ones, least squares over origins and axes."""
    ends = np.concatenate((np.zeros((1, 3)), LEVER_M * np.eye(3), -LEVER_M * np.eye(3)))
    to, source = (moved(poses, np.broadcast_to(ends, (len(poses), 7, 3))).reshape(-1, 3) for poses in (tracked, now))
    return fit_rigid(to, source) @ now


def _gap(thin: Sequence[F8], poses: F8, reach_m: float) -> float:
    """The median distance to the nearest point of another fragment, of points that have one within reach, m."""
    from scipy.spatial import KDTree

    placed = [moved(poses[number], points) for number, points in enumerate(thin)]
    found: list[F8] = []
    for number, points in enumerate(placed):
        others = [other for at, other in enumerate(placed) if at != number]
        if others:
            away = np.asarray(KDTree(np.concatenate(others)).query(points[::10])[0], np.float64)
            found.append(away[away < reach_m])
    away = np.concatenate(found) if found else np.zeros(0)
    return float(np.median(away)) if len(away) else float("nan")


def depth_points(depth_m: F8, grid: F8, valid: NDArray[np.bool_], *, farthest_m: float) -> F8:
    """Points (N, 3) in camera axes of a depth image (H, W), where it is known and the lens can be inverted.

    Args:
        depth_m: 0 or not finite where unknown.
        grid: (H, W, 2), each pixel on the plane Z = 1. valid: (H, W).
        farthest_m: depth cameras know little beyond.
    """
    known = valid & np.isfinite(depth_m) & (depth_m > 0) & (depth_m < farthest_m)
    return np.concatenate((grid[known], np.ones((int(known.sum()), 1))), axis=1) * depth_m[known][:, None]
