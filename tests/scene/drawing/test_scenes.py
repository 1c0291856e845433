import numpy as np
import pytest

from evimo.scene.drawing.scenes import SETS, draw_scene


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
