"""Every metric against an answer worked out by hand, units and zeros included."""

import numpy as np
import pytest
from pytest import approx
from scipy.spatial.transform import Rotation

from evimo.errors import BadInput
from evimo.evaluation.metrics import (
    depth_errors,
    direction_error,
    endpoint_error,
    flow_error,
    median_scale,
    overlap,
    rotation_error,
    scaled_to,
)

EVERYWHERE = np.ones((1, 4), bool)


def test_overlap_of_two_shifted_bars():
    predicted, truth = np.zeros((2, 2, 6), bool)
    predicted[:, 0:4] = True
    truth[:, 2:5] = True
    assert overlap(predicted, truth) == (4, 10)
    assert overlap(predicted, np.zeros_like(truth)) == (0, 8)
    assert overlap(np.zeros_like(truth), np.zeros_like(truth)) == (0, 0)


def test_endpoint_error_is_a_length():
    assert endpoint_error(np.array([1.0, 2, 2]), np.zeros(3)) == approx(3)
    assert endpoint_error(np.array([[1.0, 0, 0], [0, 0, 0]]), np.array([[0, 1.0, 0], [0, 0, 0]])) == approx([2**0.5, 0])


def test_scale_from_truth_keeps_the_direction_and_takes_the_length():
    assert scaled_to(np.array([0.0, 0, 0.1]), np.array([3.0, 4, 0])) == approx([0, 0, 5])
    assert scaled_to(np.zeros(3), np.array([3.0, 4, 0])) == approx([0, 0, 0])
    assert scaled_to(np.array([1.0, 0, 0]), np.zeros(3)) == approx([0, 0, 0])


@pytest.mark.parametrize("degrees", [0, 30, 60, 90, 180])
def test_error_after_scaling_is_the_chord_of_the_angle_so_zero_is_beaten_below_60_degrees(degrees):
    truth = np.array([2.0, 0, 0])
    seen = 0.01 * np.array([np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees)), 0])
    assert endpoint_error(scaled_to(seen, truth), truth) == approx(2 * 2 * np.sin(np.deg2rad(degrees) / 2), abs=1e-12)
    assert endpoint_error(scaled_to(np.zeros(3), truth), truth) == approx(2)


def test_rotation_error_about_one_axis_is_the_difference_of_speeds():
    slow, fast = np.array([[0, 0, 1.0], [0, 0, 1.5]])
    assert rotation_error(slow, fast, dt_s=0.025) == approx(0.5)
    assert rotation_error(fast, slow, dt_s=0.025) == approx(0.5)
    assert rotation_error(-slow, fast, dt_s=0.025) == approx(2.5)
    assert rotation_error(fast, fast, dt_s=0.025) == approx(0, abs=1e-9)
    assert rotation_error(np.zeros(3), np.zeros(3), dt_s=0.025) == 0


def test_rotation_error_goes_the_short_way_round():
    assert rotation_error(np.array([0, 3.0, 0]), np.array([0, -3.0, 0]), dt_s=1.0) == approx(2 * np.pi - 6)


def test_rotation_error_is_the_angle_between_the_rotations_not_the_frobenius_norm():
    random = np.random.default_rng(0)
    seen, truth = random.normal(0, 2, (2, 5, 4, 3))
    expected = [
        (Rotation.from_rotvec(0.1 * a).inv() * Rotation.from_rotvec(0.1 * b)).magnitude() / 0.1
        for a, b in zip(seen.reshape(-1, 3), truth.reshape(-1, 3), strict=True)
    ]
    assert rotation_error(seen, truth, dt_s=0.1).ravel() == approx(expected)
    assert rotation_error(seen, truth, dt_s=0.1).shape == (5, 4)


def test_direction_error_is_in_degrees_and_ignores_length():
    ahead = np.array([0, 0, 1.0])
    assert direction_error(5 * ahead, ahead) == approx(0)
    assert direction_error(-ahead, 9 * ahead) == approx(180)
    assert direction_error(np.array([0, 1.0, 1]), ahead) == approx(45)
    assert direction_error(np.zeros(3), ahead) == approx(90)
    assert direction_error(ahead + [1e-7, 0, 0], ahead) == approx(np.degrees(1e-7))


def test_flow_error_is_in_px_per_second():
    seen = np.zeros((2, 3, 4))
    truth = np.stack((np.full((3, 4), 0.3), np.full((3, 4), 0.2)))
    assert flow_error(seen, truth, (100, 200)) == approx(np.full((3, 4), 50))
    assert flow_error(truth, truth, (100, 200)) == approx(np.zeros((3, 4)))


def test_depth_that_is_right_up_to_scale_is_perfect():
    truth = np.array([[1.0, 2, 3, 8]])
    errors = depth_errors(truth / 7, truth, EVERYWHERE, scale="median")
    assert errors == approx((0, 0, 0, 1, 1, 1), abs=1e-12)
    assert median_scale(truth / 7, truth) == approx(7)


def test_depth_twice_too_far_is_log_two_off_with_no_scale_invariant_error():
    truth = np.array([[1.0, 2, 3, 8]])
    errors = depth_errors(2 * truth, truth, EVERYWHERE, scale="none")
    assert errors.abs_rel == approx(1)
    assert errors.rmse_log == approx(np.log(2))
    assert errors.silog == approx(0, abs=1e-12)
    assert (errors.delta_1, errors.delta_2, errors.delta_3) == (0, 0, 0)  # 1.25³ = 1.95


def test_silog_is_a_variance_without_square_root():
    truth = np.ones((1, 4))
    errors = depth_errors(np.exp(np.array([[-0.3, -0.3, 0.3, 0.3]])), truth, EVERYWHERE, scale="none")
    assert errors.silog == approx(0.09)
    assert errors.rmse_log == approx(0.3)


def test_deltas_count_pixels_within_a_factor_either_way():
    truth = np.full((1, 4), 10.0)
    errors = depth_errors(truth * [[1.2, 1 / 1.5, 1.9, 2.0]], truth, EVERYWHERE, scale="none")
    assert (errors.delta_1, errors.delta_2, errors.delta_3) == (0.25, 0.5, 0.75)


def test_pixels_without_depth_leave_no_trace():
    truth = np.array([[1.0, 0, 3, np.nan]])
    seen = np.array([[1.0, 99, 3, 99]])
    assert depth_errors(seen, truth, truth > 0, scale="median").abs_rel == approx(0)
    with pytest.raises(BadInput, match="no valid depth"):
        depth_errors(seen, truth, np.zeros((1, 4), bool), scale="median")


def test_depth_of_zero_is_very_wrong_but_finite():
    errors = depth_errors(np.zeros((1, 4)), np.ones((1, 4)), EVERYWHERE, scale="none")
    assert np.isfinite(errors).all() and errors.delta_3 == 0
