import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evimo.scene.drawing.gestures import TREMOR_HZ, Following, Toss, level, pendulum, trembling, upright
from evimo.scene.motion import GRAVITY, Motion, Pauses, Rest, wander

STEP = 1e-5
TOSS = Toss(np.array([0.4, -0.2, 2.0]), 0.3, 0.1)
FLIGHT_S = 2 * 2.0 / 9.81


def gestures():
    rng = np.random.default_rng(5)
    swing = pendulum(rng, 1.3, 0.6, zero_s=0.4)
    moves, turns = wander(rng, 0.5, (0.3, 2)), wander(rng, 1.0, (0.3, 2))
    yield "tossed", Motion(np.ones(3), np.eye(3), (TOSS,), turns)
    yield "on a string", Motion(np.ones(3), np.eye(3), (swing,), swing.turns)
    yield "trembling", Motion(np.ones(3), np.eye(3), (trembling(rng, moves, 0.1),), trembling(rng, turns, 0.3))
    yield "sliding", Motion(np.ones(3), np.eye(3), (level(moves),), upright(turns))
    pauses = Pauses((Rest(0.1, 0.3, 0.05), Rest(0.5, 0.6, 0.02), Rest(2.0, 3.0, 0.02)))
    leader = Motion(np.ones(3), np.eye(3), (swing,), None, Rest(0.4, 0.7, 0.05))
    yield "following", Motion(np.ones(3), np.eye(3), (Following(moves, leader, 0.8 * np.eye(3)),), turns)
    yield "turning after", Motion(np.ones(3), np.eye(3), (moves,), Following(turns, leader, rng.normal(size=(3, 3))))
    yield "pausing", Motion(np.ones(3), np.eye(3), (moves,), turns, pauses)


@pytest.mark.parametrize(("name", "motion"), list(gestures()))
def test_velocity_and_spin_are_how_poses_change(name, motion):
    time = np.linspace(0.03, 2.83, 171)
    before, now, after = motion.at(time - STEP), motion.at(time), motion.at(time + STEP)
    np.testing.assert_allclose(now.velocity, (after.position - before.position) / (2 * STEP), atol=2e-6)
    turn = Rotation.from_matrix(before.rotation.swapaxes(1, 2) @ after.rotation).as_rotvec()
    np.testing.assert_allclose(now.spin, turn / (2 * STEP), atol=2e-6)


def test_what_is_tossed_falls_freely_between_hands_and_comes_back():
    times = 0.1 + np.array([0, 1, 2, 4]) * (FLIGHT_S + 0.3)
    np.testing.assert_allclose(TOSS(times)[0], TOSS(times % (2 * (FLIGHT_S + 0.3)))[0], atol=1e-9)
    np.testing.assert_allclose(TOSS(times)[0][1], [0.4 * FLIGHT_S, -0.2 * FLIGHT_S, 0], atol=1e-9)
    np.testing.assert_allclose(TOSS(times)[0][2], 0, atol=1e-9)
    air = 0.1 + np.array([0.05, 0.2, 0.35])
    falling = (TOSS(air + STEP)[1] - TOSS(air - STEP)[1]) / (2 * STEP)
    np.testing.assert_allclose(falling, np.tile(GRAVITY, (3, 1)), atol=1e-6)
    hand = 0.1 + FLIGHT_S + np.array([1e-4, 0.2999])
    assert TOSS(hand)[1][:, 2] == pytest.approx([-2, 2], abs=0.01)


def test_a_toss_has_no_jumps():
    time = np.arange(0, 5, 1e-4)
    value, rate = TOSS(time)
    assert np.abs(np.diff(value, axis=0)).max() < 2.1e-4
    assert np.abs(np.diff(rate, axis=0)).max() < 2e-3


def test_a_thing_on_a_string_keeps_its_distance_and_swings_as_gravity_says():
    swing = pendulum(np.random.default_rng(6), 1.3, 0.4, zero_s=0.7)
    time = np.linspace(0, 40, 40_001)
    value, rate = swing(time)
    np.testing.assert_allclose(np.linalg.norm(value + (0, 0, -1.3), axis=1), 1.3, atol=1e-12)
    np.testing.assert_allclose(swing(np.array([0.7]))[0], 0, atol=1e-12)
    lowest = np.flatnonzero(np.diff(np.sign(np.diff(value[:, 2]))) > 0)
    assert 2 * np.diff(time[lowest]).mean() == pytest.approx(2 * np.pi * np.sqrt(1.3 / 9.81), rel=0.05)
    assert np.sqrt((rate**2).sum(axis=1).mean()) == pytest.approx(0.4, rel=0.1)


def test_a_tremor_is_millimetres_at_five_to_ten_hertz():
    rng = np.random.default_rng(7)
    still = wander(rng, 1e-9, (0.3, 2))
    time = np.arange(4000) / 1000
    value = trembling(rng, still, 0.05)(time)[0]
    power = np.abs(np.fft.rfft((value - value.mean(axis=0)) * np.hanning(len(time))[:, None], axis=0)) ** 2
    hertz = np.fft.rfftfreq(len(time), 1e-3)
    inside = (hertz > TREMOR_HZ[0] - 0.6) & (hertz < TREMOR_HZ[1] + 0.6)
    assert power[inside].sum() > 0.98 * power.sum()
    assert 3e-4 < value.std(axis=0).max() < 3e-3


def test_pauses_stand_still_one_after_the_other():
    moves = wander(np.random.default_rng(8), 1.0, (0.5, 2))
    motion = Motion(np.zeros(3), np.eye(3), (moves,), None, Pauses((Rest(1.0, 2.0, 0.1), Rest(3.0, 3.5, 0.1))))
    poses = motion.at(np.array([1.1, 1.5, 2.0, 3.1, 3.5]))
    assert poses.velocity == pytest.approx(0)
    assert np.ptp(poses.position[:3], axis=0) == pytest.approx(0)
    np.testing.assert_allclose(motion.at(np.array([5.0])).position, moves(np.array([3.5]))[0], atol=1e-12)
