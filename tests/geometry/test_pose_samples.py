"""Which samples are believed: those that follow in time from most others, whatever single stamps say."""

import numpy as np
import pytest

from evimo.geometry.pose_samples import checked_samples, restart_of


def resting(times_us: np.ndarray) -> np.ndarray:
    return np.tile(np.eye(4), (len(times_us), 1, 1))


@pytest.mark.parametrize("away_us", [3_600_000_000, -3_600_000_000, 7_000, -7_000])
@pytest.mark.parametrize("place", [0, 50, 99])
def test_one_lone_stamp_is_the_only_one_that_is_bad(place, away_us):
    times_us = np.arange(100, dtype=np.int64) * 5_000
    times_us[place] += away_us
    good = checked_samples(times_us, resting(times_us))
    in_order = (np.diff(times_us) > 0).all()
    assert np.count_nonzero(~good) == (0 if in_order else 1)
    assert (np.diff(times_us[good]) > 0).all()
    if abs(away_us) > 1e9 and not in_order:
        assert not good[place]


def test_of_equal_stamps_the_first_is_believed():
    times_us = np.array([0, 5_000, 5_000, 5_000, 10_000], np.int64)
    assert checked_samples(times_us, resting(times_us)).tolist() == [True, True, False, False, True]


def test_as_few_as_possible_are_bad():
    """Against trying every choice of seven stamps."""
    rng = np.random.default_rng(0)
    for _ in range(50):
        times_us = rng.integers(0, 9, 7).astype(np.int64) * 5_000
        most = 0
        for choice in range(2**7):
            chosen = times_us[[bool(choice >> k & 1) for k in range(7)]]
            if (np.diff(chosen) > 0).all():
                most = max(most, len(chosen))
        good = checked_samples(times_us, resting(times_us))
        assert np.count_nonzero(good) == most and (np.diff(times_us[good]) > 0).all()


def test_a_clock_that_starts_again_costs_what_follows():
    times_us = np.append(np.arange(500), np.arange(600)).astype(np.int64) * 5_000
    assert restart_of(times_us) == 500
    assert np.flatnonzero(checked_samples(times_us, resting(times_us))).tolist() == list(range(500))


@pytest.mark.parametrize("order", ["parts", "lone stamps", "shuffled", "late block", "very late block", "still"])
def test_what_is_only_out_of_order_is_no_restart(order):
    times_us = np.arange(1000, dtype=np.int64) * 5_000
    if order == "parts":
        times_us = np.append(times_us[600:], times_us[:600])
    elif order == "lone stamps":
        times_us[[300, 500, 501]] += np.array([10**9, -(10**9), -2_000_000])
    elif order == "shuffled":
        times_us = np.random.default_rng(0).permutation(times_us)
    elif order == "still":
        times_us[400:450] = 0
    else:
        times_us[400:450] -= 900_000 if order == "late block" else 1_900_000
    assert restart_of(times_us) == 1000


def test_of_parts_in_another_order_the_longer_is_believed():
    times_us = np.append(np.arange(100, 130), np.arange(70)).astype(np.int64) * 5_000
    assert np.flatnonzero(checked_samples(times_us, resting(times_us))).tolist() == list(range(30, 100))


def test_stamps_are_judged_among_rigid_motions_alone():
    """A pose that is none, at any time, spoils no other."""
    times_us = np.arange(20, dtype=np.int64) * 5_000
    poses = resting(times_us)
    times_us[5], poses[5] = 10**12, np.nan
    assert np.flatnonzero(~checked_samples(times_us, poses)).tolist() == [5]
