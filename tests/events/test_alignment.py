"""Axes, bias, delay and scale that were planted are found again; what does not tell them gives None."""

import re
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evimo.events.alignment import AXES, aligned
from evimo.events.gyroscope import Gyroscope

CENTRES = 12_500 + 25_000 * np.arange(4, 116)  # of slices within three seconds
BIAS = np.array([0.05, -0.08, 0.03])


def turning(time_s, strength=(0.6, 0.9, 0.4)):
    """Angular velocity (..., 3) of a hand-held camera, rad/s, camera axes."""
    swings = [(1.3, 0.2), (0.9, 1.1), (1.9, 2.0)]
    waves = [np.sin(2 * np.pi * hz * time_s + phase) + 0.4 * np.sin(9 * hz * time_s) for hz, phase in swings]
    return np.stack(waves, axis=-1) * strength


def planted(axes, *, delay_us=0, scale=1.0, rate=turning):
    """The gyroscope that, mapped by axes, bias, delay and scale, is the camera's rate."""
    t_us = np.arange(0, 3_000_001, 1000)
    own = rate((t_us - delay_us) * 1e-6) @ axes / scale + BIAS
    return Gyroscope(t_us, own + np.random.default_rng(1).normal(size=own.shape) * 2e-3, False, "made up")


def told(rate=turning, *, noise=0.05, outliers=0.0, seed=0):
    """What events say of the slices: the mean over each by 50 samples, with noise, and outliers of any size."""
    draw = np.random.default_rng(seed)
    within = (np.arange(50) - 24.5) * 500
    mean = rate((CENTRES[:, None] + within) * 1e-6).mean(axis=1)
    wrong = draw.random(len(CENTRES)) < outliers
    mean[wrong] = draw.normal(size=(wrong.sum(), 3)) * 3
    return mean + draw.normal(size=mean.shape) * noise


def test_axes_are_the_24_rotations_that_map_axes_onto_axes():
    assert len({tuple(axes.ravel()) for axes in AXES}) == 24
    assert np.allclose(np.linalg.det(AXES), 1) and np.allclose(AXES @ AXES.transpose(0, 2, 1), np.eye(3))
    quarter = {tuple(np.rint(matrix).ravel() + 0.0) for matrix in Rotation.create_group("O").as_matrix()}
    assert quarter == {tuple(axes.ravel() + 0.0) for axes in AXES}


@pytest.mark.parametrize("number", range(24))
def test_planted_axes_bias_delay_and_scale_are_found(number):
    delay_us, scale = (-83_000, 0, 20_000, 100_000)[number % 4], (0.25, 1.0, 1.5, 4.0)[number // 6]
    gyroscope = planted(AXES[number], delay_us=delay_us, scale=scale)
    found = aligned(gyroscope, CENTRES, told(noise=0.05, outliers=0.3, seed=number), np.ones(len(CENTRES)))
    assert np.array_equal(found.axes, AXES[number])
    assert abs(found.delay_us - delay_us) < 4000
    assert found.scale == pytest.approx(scale, rel=0.05)
    assert np.allclose(found.bias, BIAS, atol=0.03 / scale)
    assert found.explained > 0.9


def test_applied_it_gives_the_cameras_rate_in_the_events_clock():
    gyroscope = planted(AXES[7], delay_us=40_000, scale=2.0)
    found = aligned(gyroscope, CENTRES, told(noise=0.02), np.ones(len(CENTRES)))
    mapped = found.apply(gyroscope)
    mean, valid = mapped.mean_rates(CENTRES - 12_500, CENTRES + 12_500)
    assert mapped.in_camera_axes and not gyroscope.in_camera_axes and valid.all()
    assert np.sqrt(((mean - told(noise=0)) ** 2).mean()) < 0.02
    right = replace(found, axes=AXES[7], bias=BIAS, delay_us=40_000, scale=2.0).apply(gyroscope)
    assert np.allclose(right.rate, turning(right.t_us * 1e-6), atol=0.03)


def test_rows_that_are_no_numbers_or_have_no_weight_do_not_matter():
    gyroscope, rotation, weight = planted(AXES[3]), told(), np.ones(len(CENTRES))
    rotation[::3], rotation[1::7], weight[1::7] = np.nan, 50.0, 0.0
    assert np.array_equal(aligned(gyroscope, CENTRES, rotation, weight).axes, AXES[3])
    rotation[:-10] = np.nan
    assert aligned(gyroscope, CENTRES, rotation, weight) is None


def test_weights_say_whom_to_trust():
    rotation, weight = told(noise=0.02), np.ones(len(CENTRES))
    rotation[:70] = told(rate=lambda time_s: turning(time_s) @ AXES[9].T, noise=0.02)[:70]
    weight[:70] = 1e-3
    assert np.array_equal(aligned(planted(np.eye(3)), CENTRES, rotation, weight).axes, np.eye(3))
    found = aligned(planted(np.eye(3)), CENTRES, rotation, weight[::-1])
    assert found is None or not np.array_equal(found.axes, np.eye(3))


def test_a_still_camera_tells_nothing():
    still = planted(AXES[5], rate=lambda time_s: turning(time_s, strength=(0, 0, 0)))
    assert aligned(still, CENTRES, told(), np.ones(len(CENTRES))) is None


@pytest.mark.parametrize("seed", range(10))
def test_rotations_that_have_nothing_to_do_with_it_are_refused(seed):
    noise = np.random.default_rng(seed).normal(size=(len(CENTRES), 3))
    assert aligned(planted(AXES[5]), CENTRES, noise, np.ones(len(CENTRES))) is None


@pytest.mark.parametrize("axis", range(3))
def test_turning_about_one_axis_alone_leaves_the_two_others_open(axis):
    def rate(time_s):
        return turning(time_s, strength=np.eye(3)[axis])

    assert aligned(planted(AXES[2], rate=rate), CENTRES, told(rate), np.ones(len(CENTRES))) is None


def test_a_mirrored_gyroscope_is_refused_or_explains_little():
    """Axes that no rotation maps onto the camera's, as of a picture that is flipped."""
    mirrored = planted(np.diag([-1.0, 1, 1]))
    assert aligned(mirrored, CENTRES, told(), np.ones(len(CENTRES))) is None


def test_samples_that_end_early_leave_the_slices_they_cover():
    gyroscope = planted(AXES[0])
    short = Gyroscope(gyroscope.t_us[:1500], gyroscope.rate[:1500], False, "x")
    assert np.array_equal(aligned(short, CENTRES, told(), np.ones(len(CENTRES))).axes, AXES[0])
    shorter = Gyroscope(gyroscope.t_us[:500], gyroscope.rate[:500], False, "x")
    assert aligned(shorter, CENTRES, told(), np.ones(len(CENTRES))) is None


def test_it_says_what_it_found_in_words():
    axes = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    words = str(aligned(planted(axes, delay_us=-20_000), CENTRES, told(), np.ones(len(CENTRES))))
    pattern = (
        r"axes x = gy, y = -gx, z = gz; bias 0\.0\d+ -0\.\d+ 0\.0\d+ rad/s; delay -[12]\d\.\d ms; scale (1\.0|0\.9).*"
    )
    assert re.fullmatch(pattern + r"; 9\d% explained", words)


def test_of_an_hour_a_few_thousand_slices_are_enough():
    times = 12_500 + 25_000 * np.arange(144_000)
    t_us = np.arange(0, 3_600_000_000, 5000)
    gyroscope = Gyroscope(t_us, turning(t_us * 1e-6), False, "x")
    assert aligned(gyroscope, times, turning(times * 1e-6), np.ones(len(times))).scale == pytest.approx(1, rel=0.02)


def test_every_order_of_axes_is_tried():
    assert {tuple(np.abs(axes).argmax(axis=1)) for axes in AXES} == set(permutations(range(3)))
