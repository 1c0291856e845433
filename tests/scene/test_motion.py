import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evimo.scene.motion import (
    Motion,
    Rest,
    Throw,
    looking_at,
    random_rotation,
    right_jacobian,
    rotation_from_vector,
    wander,
)

STEP = 1e-5


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-4, 0.5, 3.0, 6.0])
def test_rotation_from_vector_is_the_rotation_about_it(size):
    vector = np.random.default_rng(0).normal(size=(20, 3))
    vector *= size / np.linalg.norm(vector, axis=1, keepdims=True)
    np.testing.assert_allclose(rotation_from_vector(vector), Rotation.from_rotvec(vector).as_matrix(), atol=1e-12)


@pytest.mark.parametrize("size", [1e-6, 9e-4, 1.1e-3, 0.1, 2.0])
def test_right_jacobian_is_the_body_rate_of_a_growing_vector(size):
    rng = np.random.default_rng(1)
    vector, rate = rng.normal(size=3), rng.normal(size=3)
    vector *= size / np.linalg.norm(vector)
    before, after = (rotation_from_vector(vector + sign * STEP * rate) for sign in (-1, 1))
    expected = Rotation.from_matrix(before.T @ after).as_rotvec() / (2 * STEP)
    np.testing.assert_allclose(right_jacobian(vector) @ rate, expected, atol=1e-8)


def motions():
    rng = np.random.default_rng(2)
    moves, turns = wander(rng, 0.7, (0.3, 3)), wander(rng, 2.0, (0.3, 3))
    at, way = np.array([1.0, -2, 0.5]), random_rotation(rng)
    yield "wanders", Motion(at, way, (moves,), turns)
    yield "thrown", Motion(at, way, (Throw(np.array([1.0, 0, 2]), 0.2), moves), turns)
    yield "rests", Motion(at, way, (moves,), turns, Rest(0.1, 0.4, 0.2))
    yield "stands", Motion(at, way)


@pytest.mark.parametrize(("name", "motion"), list(motions()))
def test_velocity_and_spin_are_how_poses_change(name, motion):
    time = np.linspace(0.03, 0.83, 23)
    before, now, after = motion.at(time - STEP), motion.at(time), motion.at(time + STEP)
    np.testing.assert_allclose(now.velocity, (after.position - before.position) / (2 * STEP), atol=1e-7)
    turn = Rotation.from_matrix(before.rotation.swapaxes(1, 2) @ after.rotation).as_rotvec()
    np.testing.assert_allclose(now.spin, turn / (2 * STEP), atol=1e-7)


def test_a_wandering_curve_is_zero_when_asked_and_has_the_asked_speed():
    curve = wander(np.random.default_rng(3), 0.4, (0.3, 3), zero_s=1.7)
    assert curve(np.array([1.7]))[0] == pytest.approx(0)
    rate = curve(np.linspace(0, 2000, 200_001))[1]
    assert np.sqrt((rate**2).sum(axis=1).mean()) == pytest.approx(0.4, rel=0.01)


def test_a_thrown_body_falls():
    position, velocity = Throw(np.array([1.0, 0, 0]), 0.5)(np.array([0.5, 1.5]))
    np.testing.assert_allclose(position, [[0, 0, 0], [1, 0, -9.81 / 2]])
    np.testing.assert_allclose(velocity, [[1, 0, 0], [1, 0, -9.81]])


def test_at_rest_nothing_moves_and_the_journey_goes_on_afterwards():
    rng = np.random.default_rng(4)
    moves = wander(rng, 1.0, (0.5, 2))
    motion = Motion(np.zeros(3), np.eye(3), (moves,), None, Rest(1.0, 2.0, 0.1))
    poses = motion.at(np.array([1.1, 1.5, 2.0]))
    assert np.ptp(poses.position, axis=0) == pytest.approx(0)
    assert poses.velocity == pytest.approx(0)
    late = motion.at(np.array([3.0]))
    np.testing.assert_allclose(late.position, moves(np.array([2.0]))[0], atol=1e-12)  # one second was lost


def test_convention_camera_axes_are_right_down_forward():
    axes = looking_at(np.array([0.0, 0, 1]), np.array([0.0, 5, 1]))
    np.testing.assert_allclose(axes, np.transpose([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)
