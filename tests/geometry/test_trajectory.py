"""A path with known speed: splines give its poses and twists, and find what does not belong to it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from evimo.geometry.rotations import (
    angles_of_matrices,
    inverse_poses,
    matrices_of_angles,
    matrices_of_quaternions,
    quaternions_of_matrices,
)
from evimo.geometry.trajectory import fit_trajectory

STEP_US = 5_000


def path(times_us):
    """A screw: constant twist in the body's axes, which are turned about their start."""
    t = np.asarray(times_us)[:, None] * 1e-6
    poses = np.tile(np.eye(4), (len(t), 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(t * (0.4, -2.0, 1.1)).as_matrix()
    poses[:, :3, 3] = np.concatenate((0.3 * np.sin(4 * t), 0.2 * np.cos(5 * t), 1 + 0.5 * t), axis=1)
    return poses


def velocity(times_us):
    t = np.asarray(times_us)[:, None] * 1e-6
    return np.concatenate((1.2 * np.cos(4 * t), -1.0 * np.sin(5 * t), np.full_like(t, 0.5)), axis=1)


def samples(seconds=2.0):
    times = np.arange(0, int(seconds * 1e6), STEP_US)
    return times, path(times)


def test_poses_and_twists_are_those_of_the_path():
    times, poses = samples()
    at = np.arange(50_003, 1_900_000, 7_919)
    motion = fit_trajectory(times, poses).at(at)
    assert motion.valid.all()
    np.testing.assert_allclose(motion.world_from_body, path(at), atol=3e-6)
    world = np.einsum("mij,mj->mi", path(at)[:, :3, :3], motion.twist[:, :3])
    np.testing.assert_allclose(world, velocity(at), atol=5e-4)
    np.testing.assert_allclose(motion.twist[:, 3:], np.tile((0.4, -2.0, 1.1), (len(at), 1)), atol=1e-3)


def test_jitter_of_motion_capture_averages_out():
    """A tenth of a millimetre is 2.8 cm/s between two samples, and less than a third of that along the spline."""
    rng = np.random.default_rng(0)
    times = np.arange(0, 3_000_000, STEP_US)
    poses = np.tile(np.eye(4), (len(times), 1, 1))
    poses[:, :3, 3] = rng.normal(0, 1e-4, (len(times), 3))
    differences = np.diff(poses[:, 0, 3]) / 5e-3
    motion = fit_trajectory(times, poses).at(times[20:-20])
    assert differences.std() > 0.025
    assert motion.twist[:, 0].std() < differences.std() / 3


@pytest.mark.parametrize("kind", ["away", "nan", "stretched", "small", "late", "flipped"])
def test_bad_samples_are_found_and_bridged(kind):
    times, poses = samples()
    spoilt = [100, 101, 250]
    if kind == "away":
        poses[spoilt, 0, 3] += 1
    elif kind == "nan":
        poses[spoilt] = np.nan
    elif kind == "stretched":
        poses[spoilt, :3, :3] *= 1.1
    elif kind == "small":
        poses[spoilt, 1, 3] += 0.01
    elif kind == "late":
        times[spoilt] = times[50]
    else:
        poses[spoilt, :3, :3] = poses[spoilt, :3, :3] @ np.diag([1, -1, -1])
    trajectory = fit_trajectory(times, poses)
    assert np.flatnonzero(trajectory.bad).tolist() == spoilt
    at = np.arange(480_000, 530_000, 1_000)
    np.testing.assert_allclose(trajectory.at(at).world_from_body, path(at), atol=2e-5)
    assert trajectory.at(at).valid.all()


def test_long_gaps_are_void_and_short_ones_bridged():
    times, poses = samples()
    kept = ((times < 500_000) | (times >= 530_000)) & ((times < 1_000_000) | (times >= 1_200_000))
    trajectory = fit_trajectory(times[kept], poses[kept])
    at = np.array([-1, 0, 515_000, 995_000, 1_000_000, 1_100_000, 1_199_999, 1_200_000, 1_995_000, 1_995_001])
    assert trajectory.at(at).valid.tolist() == [False, True, True, True, False, False, False, True, True, False]
    np.testing.assert_allclose(trajectory.at(at[2:3]).world_from_body, path(at[2:3]), atol=1e-4)


def test_a_jump_without_return_ends_a_piece_and_leaves_no_speed_behind():
    times, poses = samples()
    poses[200:, 2, 3] += 0.5
    motion = fit_trajectory(times, poses).at(np.array([990_000, 997_000, 1_005_000]))
    assert motion.valid.tolist() == [True, False, True]
    assert np.linalg.norm(motion.twist[:, :3], axis=1)[[0, 2]].max() < 1.7


def test_convention_the_twist_is_in_the_bodys_own_axes():
    """A body that has turned a quarter about z and goes along the world's x goes along its own -y."""
    times = np.arange(0, 500_000, STEP_US)
    poses = np.tile(np.eye(4), (len(times), 1, 1))
    poses[:, :3, :3] = Rotation.from_euler("z", 90, degrees=True).as_matrix()
    poses[:, 0, 3] = times * 1e-6
    twist = fit_trajectory(times, poses).at(np.array([250_000])).twist[0]
    np.testing.assert_allclose(twist, (0, -1, 0, 0, 0, 0), atol=1e-6)


@pytest.mark.parametrize("number", [0, 1, 2, 3, 5, 49, 200])
def test_any_number_of_samples(number):
    times, poses = samples()
    trajectory = fit_trajectory(times[:number], poses[:number])
    motion = trajectory.at(times[: max(number, 1)])
    assert motion.valid.all() == (number > 1)
    if number > 1:
        np.testing.assert_allclose(motion.world_from_body, poses[:number], atol=1e-3)


def test_turning_the_world_and_the_body_turns_the_path():
    times, poses = samples(0.5)
    rng = np.random.default_rng(1)
    left, right = np.eye(4), np.eye(4)
    left[:3, :3], right[:3, :3] = Rotation.random(2, rng=rng).as_matrix()
    left[:3, 3] = rng.normal(size=3)
    one, two = fit_trajectory(times, poses), fit_trajectory(times, left @ poses @ right)
    at = np.arange(10_000, 480_000, 9_001)
    np.testing.assert_allclose(left @ one.at(at).world_from_body @ right, two.at(at).world_from_body, atol=1e-9)


def test_rotations_agree_with_scipy_far_from_and_at_the_singular_angles():
    rng = np.random.default_rng(0)
    whole = np.concatenate((Rotation.random(200, rng=rng).as_rotvec(), np.pi * np.eye(3), np.zeros((1, 3))))
    rotation = Rotation.from_rotvec(whole)
    matrices = rotation.as_matrix()
    np.testing.assert_allclose(matrices_of_quaternions(rotation.as_quat()[:, [3, 0, 1, 2]] * 2.5), matrices, atol=1e-12)
    np.testing.assert_allclose(matrices_of_quaternions(quaternions_of_matrices(matrices)), matrices, atol=1e-12)
    np.testing.assert_allclose(matrices_of_angles(angles_of_matrices(matrices)), matrices, atol=1e-12)
    angles = rng.uniform(-1.5, 1.5, (50, 3))
    np.testing.assert_allclose(matrices_of_angles(angles), Rotation.from_euler("xyz", angles).as_matrix(), atol=1e-12)
    np.testing.assert_allclose(
        inverse_poses(path(np.arange(9))) @ path(np.arange(9)), np.tile(np.eye(4), (9, 1, 1)), atol=1e-12
    )


def test_between_two_samples_the_shortest_turn_is_taken():
    times = np.array([0, 40_000])
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[1, :3, :3] = Rotation.from_rotvec((0, 0, 0.3)).as_matrix()
    middle = Slerp([0, 1], Rotation.from_matrix(poses[:, :3, :3]))(0.5).as_matrix()
    found = fit_trajectory(times, poses).at(np.array([20_000])).world_from_body[0, :3, :3]
    np.testing.assert_allclose(found, middle, atol=1e-3)
