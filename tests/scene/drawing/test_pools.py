"""What is drawn for one part of a data set is never drawn for another: seen in the scenes themselves."""

import numpy as np
import pytest

from evimo.scene.drawing.pools import POOLS, family
from evimo.scene.drawing.scenes import SETS, draw_scene
from evimo.scene.textures.bank import texture_bank
from evimo.scene.textures.patterns import SIZE


@pytest.fixture(scope="module")
def scenes():
    banks = {part: texture_bank(0, plain=4, dense=36, pool=pool.number) for part, pool in POOLS.items()}
    return {
        part: [
            draw_scene(np.random.default_rng((number, seed)), SETS[number], banks[part], seconds=1, pool=pool)
            for number in SETS
            for seed in range(30)
        ]
        for part, pool in POOLS.items()
    }


def patterns(drawn):
    """The finest level of every texture on something, as bytes."""
    found = set()
    for scene in drawn:
        levels = scene.bank.texels.reshape(-1)[: 40 * SIZE * SIZE].reshape(40, SIZE, SIZE)
        found |= {levels[part.surface.texture].tobytes() for body in scene.bodies for part in body.parts}
    return found


def families(drawn):
    """Of movers and of clutter, which are the objects; the room is the first body."""
    return {family(part.shape for part in body.parts) for scene in drawn for body in scene.bodies[1:]}


def test_parts_share_no_texture(scenes):
    train, test = (patterns(scenes[part]) for part in ("train", "test"))
    assert len(train) == len(test) == 40
    assert not train & test


def test_parts_share_no_family_of_shapes(scenes):
    train, test = (families(scenes[part]) for part in ("train", "test"))
    assert len(train) > 15
    assert len(test) > 15
    assert not train & test


def test_both_parts_have_small_and_large_compounds(scenes):
    for drawn in scenes.values():
        assert {sum(found) for found in families(drawn)} >= {1, 2, 3, 4, 5}


def test_banks_of_a_pool_are_not_those_without_one():
    banks = [texture_bank(3, plain=2, dense=2, pool=number).texels[: 4 * SIZE * SIZE] for number in (0, 1, 2)]
    seen = [{pattern.tobytes() for pattern in bank.reshape(4, SIZE, SIZE)} for bank in banks]
    assert len(set.union(*seen)) == 12


def test_scenes_from_a_pool_always_have_the_movers_of_their_set(scenes):
    for drawn in scenes.values():
        counts = {number: {len(s.movers) for s in drawn[30 * k : 30 * (k + 1)]} for k, number in enumerate(SETS)}
        assert counts == {number: set(style.movers) for number, style in SETS.items()}


def test_what_moves_in_a_long_scene_stays_near_and_keeps_its_pace(bank):
    """Each excursion is held to 0.2 m rms, but the camera of a fast set is still faster than that of a slow one."""
    times, speeds = np.linspace(0, 60, 600), {}
    for number in (3, 4):
        drawn = [
            draw_scene(np.random.default_rng(seed), SETS[number], bank, seconds=60, pool=POOLS["test"])
            for seed in range(20)
        ]
        for scene in drawn:
            for motion in (scene.camera, *(body.motion for body in scene.movers)):
                away = np.linalg.norm(motion.at(times).position - motion.position, axis=1)
                assert np.sqrt((away**2).mean()) < 1
        speeds[number] = [np.linalg.norm(scene.camera.at(times).velocity, axis=1).mean() for scene in drawn]
        assert min(speeds[number]) > 0.01  # of one that turns after a mover and hardly sways
    assert np.median(speeds[3]) > 3 * np.median(speeds[4])
