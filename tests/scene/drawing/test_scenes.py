from dataclasses import replace

import numpy as np
import pytest

from evimo.scene.drawing.gestures import Following
from evimo.scene.drawing.moving import following
from evimo.scene.drawing.scenes import FOLLOWED, SETS, draw_scene
from evimo.scene.motion import Motion, Throw, wander


@pytest.fixture(scope="module")
def scenes(bank):
    return {
        number: [draw_scene(np.random.default_rng((number, seed)), style, bank, seconds=0.3) for seed in range(40)]
        for number, style in SETS.items()
    }


@pytest.mark.parametrize("number", SETS)
def test_movers_are_as_many_as_the_set_says_or_none(number, scenes):
    counts = {len(scene.movers) for scene in scenes[number]}
    assert counts == {0, *SETS[number].movers}


def test_every_sixth_scene_or_so_has_no_mover(scenes):
    still = np.mean([not scene.movers for drawn in scenes.values() for scene in drawn])
    assert 0.1 < still < 0.26


def test_most_scenes_have_clutter_as_near_as_the_movers(scenes):
    near, clutter = [], []
    for scene in (scene for drawn in scenes.values() for scene in drawn):
        eye = scene.camera.position
        near += [np.linalg.norm(body.motion.position - eye) for body in scene.movers]
        clutter.append([np.linalg.norm(body.parts[0].position - eye) for body in scene.bodies if body.clutter])
    assert 0.8 < np.mean([len(bodies) >= 3 for bodies in clutter]) < 0.97
    assert np.median(np.concatenate(clutter)) == pytest.approx(np.median(near), rel=0.15)


def aside(body, scene, time_s):
    """Where a body's origin is in the picture of a pinhole camera with focal length 1."""
    camera, at = scene.camera.at(time_s), body.motion.at(time_s).position
    x, y, z = np.einsum("tij,ti->jt", camera.rotation, at - camera.position)
    return np.stack((x / z, y / z))


def test_cameras_that_follow_keep_a_mover_in_its_place_while_the_room_flies_by(bank):
    time_s = np.linspace(0, 1, 21)
    kept, still = [], []
    for seed in range(60):
        scene = draw_scene(np.random.default_rng((seed, 3)), replace(SETS[2], movers=(1,)), bank, seconds=1)
        for body in scene.movers:
            if isinstance(body.motion.moves[0], Throw):
                continue
            calm = replace(scene.camera, moves=(wander(np.random.default_rng(0), 1e-9, (1, 2)),), rest=None)
            calm = replace(calm, turns=calm.moves[0])
            followed = following(np.random.default_rng(seed), calm, [body.motion])
            kept.append(np.ptp(aside(body, replace(scene, camera=followed), time_s), axis=1).max())
            still.append(np.ptp(aside(body, replace(scene, camera=calm), time_s), axis=1).max())
    assert len(kept) > 30
    assert np.median(np.array(kept) / np.array(still)) < 0.4
    assert np.mean(np.array(kept) < np.array(still)) > 0.85


def test_nobody_follows_what_is_thrown_away():
    still = wander(np.random.default_rng(0), 1e-9, (1, 2))
    camera = Motion(np.zeros(3), np.eye(3), (still,), still)
    thrown = Motion(np.ones(3), np.eye(3), (Throw(np.ones(3), 0.5),))
    assert following(np.random.default_rng(1), camera, [thrown]) is camera


def test_half_the_cameras_that_can_follow_do(scenes):
    drawn = [scene for each in scenes.values() for scene in each if scene.movers]
    led = [isinstance(s.camera.turns, Following) or isinstance(s.camera.moves[0], Following) for s in drawn]
    assert FOLLOWED - 0.12 < np.mean(led) < FOLLOWED + 0.1


def test_sets_differ_in_speed(scenes):
    def speed(number):
        return np.median([np.linalg.norm(s.camera.at(np.array([0.1])).velocity) for s in scenes[number]])

    assert speed(3) > 1.5 * speed(5) > 2 * speed(4)


def test_the_same_seed_draws_the_same_scene(bank):
    one, two = (draw_scene(np.random.default_rng(5), SETS[5], bank, seconds=1) for _ in range(2))
    assert len(one.bodies) == len(two.bodies)
    np.testing.assert_array_equal(one.camera.at(np.array([0.7])).position, two.camera.at(np.array([0.7])).position)
    for a, b in zip(one.bodies, two.bodies, strict=True):
        assert [p.surface for p in a.parts] == [p.surface for p in b.parts]
