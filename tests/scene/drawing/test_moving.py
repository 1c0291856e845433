"""Cameras that follow, and movers that pass through nothing."""

import numpy as np
import pytest

from evimo.scene.bodies import CYLINDER, GRATING
from evimo.scene.drawing.gestures import Following
from evimo.scene.drawing.moving import FOLLOWED, following, is_thrown_away
from evimo.scene.drawing.scenes import SETS, draw_scene
from evimo.scene.motion import Motion, Throw, looking_at, wander

STEP = 1e-4


@pytest.fixture(scope="module")
def scenes(bank):
    styles = list(SETS.values())
    return [draw_scene(np.random.default_rng((k, 9)), styles[k % 6], bank, seconds=1) for k in range(240)]


def in_picture(point, camera, time_s):
    """Where points (T, 3) or (3,) in the world are in the picture of a pinhole camera with focal length 1."""
    poses = camera.at(time_s)
    x, y, z = np.einsum("tij,ti->jt", poses.rotation, point - poses.position)
    return np.stack((x / z, y / z))


def speed(point_at, camera):
    """Root mean square over a second, 1/s."""
    time_s = np.linspace(0, 1, 41)
    before, after = (in_picture(point_at(t), camera, t) for t in (time_s - STEP, time_s + STEP))
    return np.sqrt((((after - before) / (2 * STEP)) ** 2).sum(axis=0).mean())


def leader_of(scene):
    (curve,) = (each for each in (scene.camera.turns, *scene.camera.moves) if isinstance(each, Following))
    return curve.leader


def test_half_the_cameras_that_can_follow_do(scenes):
    able = [s for s in scenes if any(body.motion.moves and not is_thrown_away(body.motion) for body in s.movers)]
    follow = [any(isinstance(c, Following) for c in (s.camera.turns, *s.camera.moves)) for s in able]
    assert np.mean(follow) == pytest.approx(FOLLOWED, abs=0.1)


def test_what_a_camera_follows_moves_less_in_the_picture_than_what_stands_there(scenes):
    mover, static = [], []
    for scene in scenes:
        if any(isinstance(c, Following) for c in (scene.camera.turns, *scene.camera.moves)):
            leader = leader_of(scene)
            if np.sqrt((leader.at(np.linspace(0, 1, 21)).velocity ** 2).sum(axis=1).mean()) < 0.15:
                continue
            mover.append(speed(lambda t, leader=leader: leader.at(t).position, scene.camera))
            static.append(speed(lambda _, leader=leader: leader.position, scene.camera))
    mover, static = np.array(mover), np.array(static)
    assert len(mover) > 40
    assert np.median(mover / static) < 0.9
    assert np.mean(mover < static) > 0.72


@pytest.mark.parametrize("pan", [False, True])
def test_who_follows_wholly_keeps_a_mover_in_its_place(pan):
    """A small way at a known place beside the axis; with half of the share, half of the way is left."""
    axes = looking_at(np.array([0.3, -1.0, 1.2]), np.array([0.1, 0.5, 0.2]))
    still = wander(np.random.default_rng(0), 1e-12, (1, 2))
    camera = np.array([0.3, -1.0, 1.2]), axes
    place = camera[0] + axes @ (0.5, -0.3, 1.7)
    way = axes @ np.array([0.04, -0.03, 0.0])
    mover = Motion(place, np.eye(3), (lambda t: (np.outer(t, way), np.tile(way, (len(t), 1))),))
    time_s = np.array([1.0])

    def shift(share):
        moves, turns = following(camera, (still, still), mover, share, pan=pan)
        now = in_picture(mover.at(time_s).position, Motion(*camera, (moves,), turns), time_s)[:, 0]
        return now - np.array([0.5, -0.3]) / 1.7

    np.testing.assert_allclose(shift(0.0), np.array([0.04, -0.03]) / 1.7, atol=1e-9)
    np.testing.assert_allclose(shift(0.5), np.array([0.02, -0.015]) / 1.7, atol=3e-4)
    np.testing.assert_allclose(shift(1.0), 0, atol=6e-4)


def test_what_is_thrown_away_is_told_from_what_is_not():
    assert is_thrown_away(Motion(np.ones(3), np.eye(3), (Throw(np.ones(3), 0.5),)))
    assert not is_thrown_away(Motion(np.ones(3), np.eye(3)))


def passes_through(body, solid, dice, within):
    """Whether a fiftieth of a mover, without thin rods, is ever within another part in a second."""
    own = [part for part in body.parts if not is_thin(part)][:5]
    poses = body.motion.at(np.linspace(0, 1, 11))
    points = np.concatenate([part.position + (dice * part.half) @ part.rotation.T for part in own])
    for turn, at in zip(poses.rotation, poses.position, strict=True):
        if any(within(part, points @ turn.T + at).mean() > 0.02 for part in solid):
            return True
    return False


def is_thin(part):
    return part.shape == CYLINDER and part.half.min() < 0.012


def test_hardly_a_mover_passes_through_anything_within_a_second(scenes, within):
    """One in twelve; one in five before ways were looked for."""
    dice, passing = np.random.default_rng(0).uniform(-0.9, 0.9, (60, 3)), []
    for scene in scenes:
        static = [part for body in scene.bodies if body.motion is None for part in body.parts]
        solid = [part for part in static if not part.inside and part.shape != GRATING and not is_thin(part)]
        passing += [passes_through(body, solid, dice, within) for body in scene.movers]
    assert np.mean(passing) < 0.12
