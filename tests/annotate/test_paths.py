"""Paths fitted a stretch at a time: the same across borders, and lost where nothing was seen."""

import numpy as np

from evimo.annotate.paths import STRETCH_US, BodyPath
from evimo.captures.tracks import track_of


def circling(t_s):
    """A body that goes round a circle of 1 m in 2π s and turns with it: 1 m/s along its own x, 1 rad/s about z."""
    angle = t_s + np.pi / 2
    zero = np.zeros_like(t_s)
    turned = np.stack((zero, zero, np.sin(angle / 2), np.cos(angle / 2)), axis=1)
    return np.concatenate((np.stack((np.cos(t_s), np.sin(t_s), zero), axis=1), turned), axis=1)


def test_a_path_does_not_feel_where_its_stretches_meet():
    rng = np.random.default_rng(0)
    times_us = np.arange(STRETCH_US - 3_000_000, STRETCH_US + 3_000_000, 5_000)
    poses = circling(times_us * 1e-6)
    poses[:, :3] += rng.normal(scale=2e-4, size=(len(poses), 3))
    path = BodyPath(track_of("body", times_us, poses, np.ones(len(times_us), bool)))
    asked = STRETCH_US + np.arange(-500_000, 500_000, 777)
    motion = path.at(asked)
    assert motion.valid.all()
    exact = circling(asked * 1e-6)[:, :3]
    assert np.abs(motion.world_from_body[:, :3, 3] - exact).max() < 5e-4
    assert np.abs(motion.twist - [1, 0, 0, 0, 0, 1]).max() < 0.05
    border = path.at(np.array([STRETCH_US - 1, STRETCH_US]))
    assert np.abs(np.diff(border.world_from_body[:, :3, 3], axis=0)).max() < 1.1e-6  # 1 µs at 1 m/s, and no step


def test_a_gap_is_lost_and_the_last_sight_is_known():
    times_us = np.arange(0, 1_000_000, 5_000)
    tracked = (times_us < 300_000) | (times_us >= 700_000)
    path = BodyPath(track_of("body", times_us, circling(times_us * 1e-6), tracked))
    asked = np.array([-5, 295_000, 400_000, 695_000, 700_000, 2_000_000])
    assert path.at(asked).valid.tolist() == [False, True, False, False, True, False]
    assert path.last_seen_us(asked).tolist() == [0, 295_000, 295_000, 295_000, 700_000, 995_000]
