"""Paths fitted a stretch at a time: the same across borders, and lost where nothing was seen."""

import numpy as np

from evimo.annotate.paths import STRETCH_US, BodyPath
from evimo.annotate.tracked import Body
from evimo.captures.tracks import track_of
from evimo.recordings.paths import paths_of


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


def sliding(times_us, speed_mps):
    """Poses along x at speeds (M,) that hold from each time to the next."""
    x = np.append(0, np.cumsum(speed_mps[:-1] * np.diff(times_us) * 1e-6))
    return np.column_stack((x, np.zeros((len(x), 5)), np.ones(len(x))))


def test_what_moves_is_told_as_in_datasets():
    """From 3 cm/s on until it is slower than half of that, also where stretches meet: here from 5 cm/s to 2, to 0."""
    times_us = np.arange(STRETCH_US - 4_000_000, STRETCH_US + 4_000_000, 5_000)
    since_s = (times_us - STRETCH_US) * 1e-6
    speed = np.select([since_s < -3, since_s < -2, since_s < 2], [0.02, 0.05, 0.02], 0.0)
    poses = sliding(times_us, speed)
    body = Body(BodyPath(track_of("body", times_us, poses, np.ones(len(times_us), bool))), np.eye(4))
    seconds = np.array([-3.5, -2.5, -1.5, -0.5, 0.0, 1.5, 2.5])
    asked = STRETCH_US + np.rint(seconds * 1e6).astype(np.int64)
    assert body.moving(asked).tolist() == [False, True, True, True, True, True, False]
    placed = np.tile(np.eye(4), (len(poses), 1, 1))
    placed[:, 0, 3] = poses[:, 0]
    paths = paths_of(times_us, np.tile(np.eye(4), (len(poses), 1, 1)), {1: placed})
    assert paths.motions(asked)["moving"][:, 0].tolist() == body.moving(asked).tolist()


def test_a_body_that_was_never_seen_does_not_move():
    times_us = np.arange(0, 100_000, 5_000)
    path = BodyPath(track_of("body", times_us, sliding(times_us, np.full(20, 0.1)), np.zeros(20, bool)))
    assert Body(path, np.eye(4)).moving(np.array([-5, 50_000, 10**9])).tolist() == [False] * 3
