"""Mean rates of a gyroscope, against a camera that is really turned."""

import numpy as np
import pytest
from pytest import approx
from scipy.spatial.transform import Rotation

from evimo.events.gyroscope import Gyroscope, gyroscope_of

T = 1_000_000 + 1000 * np.arange(501)


def made(t_us, rate):
    return Gyroscope(t_us, rate, in_camera_axes=True, source="made up")


@pytest.fixture
def wave():
    """The x axis swings, the two others turn evenly."""
    phase = (T - T[0]) * 1e-6 * 2 * np.pi * 3
    return made(T, np.stack([np.sin(phase), np.full(len(T), 0.5), np.full(len(T), -0.25)], axis=1))


def test_the_mean_of_a_swing_is_its_integral(wave):
    start, stop = 1_012_345, 1_098_765
    mean = wave.mean_rate(start, stop)
    swing = [np.cos((at - T[0]) * 1e-6 * 6 * np.pi) / (6 * np.pi) for at in (start, stop)]
    expected = ((swing[0] - swing[1]) / ((stop - start) * 1e-6), 0.5, -0.25)
    assert np.allclose(mean, expected, atol=5e-5)


def test_a_camera_turned_about_one_axis_turns_by_mean_rate_times_time():
    """Rotations sampled at 1 kHz give the gyroscope; their own change over 25 ms is what it must say."""
    axis = np.array([2.0, -1.0, 2.0]) / 3
    angle = 0.3 * np.sin(5e-6 * (T - T[0])) + 0.7e-6 * (T - T[0])
    rotations = Rotation.from_rotvec(angle[:, None] * axis)
    rate = np.gradient(angle, T * 1e-6)[:, None] * axis
    mean = made(T, rate).mean_rate(1_100_000, 1_125_000)
    change = (rotations[100].inv() * rotations[125]).as_rotvec() / 0.025
    assert np.allclose(mean, change, atol=2e-4)


def test_means_of_halves_make_the_mean_of_the_whole(wave):
    whole, left, right = (wave.mean_rate(*span) for span in ((T[3], T[9]), (T[3], T[5] + 1), (T[5] + 1, T[9])))
    assert np.allclose(whole * 6000, left * 2001 + right * 3999)


def test_many_intervals_at_once_are_what_each_is_alone(wave):
    start = np.array([1_000_000, 1_000_001, 1_499_000, 1_499_001, 999_999])
    rate, valid = wave.mean_rates(start, start + 1000)
    assert valid.tolist() == [True, True, True, False, False]
    assert np.array_equal(rate[1], wave.mean_rate(1_000_001, 1_001_001))


@pytest.mark.parametrize(
    "start, stop", [(999_999, 1_100_000), (1_400_000, 1_500_001), (1_200_000, 1_200_000), (1_200_001, 1_200_000)]
)
def test_what_samples_do_not_cover_is_none(wave, start, stop):
    assert wave.mean_rate(start, stop) is None


def test_a_gap_is_none_only_for_intervals_that_touch_it(wave):
    kept = (T <= 1_200_000) | (T > 1_220_000)  # 21 ms without a sample
    gappy = made(T[kept], wave.rate[kept])
    for span in ((1_150_000, 1_200_000), (1_221_000, 1_300_000)):
        assert gappy.mean_rate(*span) == approx(wave.mean_rate(*span), abs=1e-9)
    for span in ((1_190_000, 1_200_001), (1_205_000, 1_206_000), (1_220_999, 1_230_000), (1_100_000, 1_300_000)):
        assert gappy.mean_rate(*span) is None
    kept |= T == 1_210_000
    whole = wave.mean_rate(1_100_000, 1_300_000)
    assert made(T[kept], wave.rate[kept]).mean_rate(1_100_000, 1_300_000) == approx(whole, abs=0.05 * abs(whole).max())


def test_stored_samples_are_sorted_and_what_is_no_number_is_left_out():
    rate = np.arange(15.0).reshape(5, 3)
    rate[1, 2] = np.nan
    found = gyroscope_of(np.array([5, 4, 3, 3, 1]), rate, in_camera_axes=False, source="x")
    assert found.t_us.tolist() == [1, 3, 5] and found.rate[:, 0].tolist() == [12, 6, 0]
    assert (len(found), found.rate_hz) == (3, 5e5)
    assert gyroscope_of(np.array([1, 1]), rate[2:4], in_camera_axes=False, source="x") is None
