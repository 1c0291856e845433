import itertools

import numpy as np
import pytest

from evimo.scene.bodies import BOX, CYLINDER, MOST_PARTS
from evimo.scene.drawing.furniture import Room, add_chair, lay_floor_details, lean_ladder
from evimo.scene.drawing.objects import rod
from evimo.scene.drawing.paint import Paint
from evimo.scene.drawing.pools import POOLS
from evimo.scene.drawing.scenes import SETS, draw_scene

SEEDS = range(30)


@pytest.fixture
def room(bank):
    return Room(np.random.default_rng(0), Paint(bank, 0.5, (0.5, 2), (0.3, 1)), np.array([2.0, 2, 1.4]))


def ends(part):
    """Of a rod (2, 3), in the world."""
    return part.position + part.half[2] * np.outer((-1, 1), part.rotation[:, 2])


@pytest.mark.parametrize("way", [(0, 0, 1), (0, 0, -1), (1, 0, 0), (-0.3, 0.5, 0.2)])
def test_a_rod_reaches_from_one_point_to_the_other(way, room):
    start, stop = np.array([0.1, 0.2, 0.3]), np.array([0.1, 0.2, 0.3]) + way
    made = rod(start, stop, 0.01, room.paint.surface(room.rng))
    np.testing.assert_allclose(ends(made), [start, stop], atol=1e-12)
    np.testing.assert_allclose(made.rotation @ made.rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(made.rotation) == pytest.approx(1)


def test_a_chair_has_four_thin_legs_on_the_floor_and_one_metal(room):
    add_chair(room, np.array([0.5, -0.3]))
    legs = [part for part in room.parts if part.shape == CYLINDER]
    assert [ends(leg)[:, 2].min() for leg in legs] == pytest.approx([0] * 4, abs=1e-9)
    assert max(leg.half[0] for leg in legs) < 0.02
    assert len({leg.surface for leg in legs}) == 1


def test_a_cable_is_a_chain_and_lies_on_the_floor(room):
    while sum(part.shape == CYLINDER for part in room.parts) == 0:
        room.parts.clear()
        lay_floor_details(room)
    rods = [part for part in room.parts if part.shape == CYLINDER]
    joined = [np.linalg.norm(ends(a)[1] - ends(b)[0]) < 1e-9 for a, b in itertools.pairwise(rods)]
    assert sum(joined) >= len(joined) - 1  # at most two cables
    assert all(0.003 < ends(rod)[:, 2].min() < 0.02 for rod in rods)


def test_a_ladder_leans_within_the_room(room):
    lean_ladder(room)
    points = np.concatenate([ends(part) for part in room.parts])
    assert points[:, 1].max() < room.half[1]
    assert points[:, 2].min() == pytest.approx(0)
    assert len(room.parts) > 5


@pytest.mark.parametrize("number", SETS)
def test_scenes_have_no_more_parts_than_the_renderer_takes(number, bank):
    for seed in SEEDS:
        rng = np.random.default_rng((number, seed))
        scene = draw_scene(rng, SETS[number], bank, seconds=0.3, pool=POOLS["train"])
        assert sum(len(body.parts) for body in scene.bodies) <= MOST_PARTS


@pytest.mark.parametrize("number", [3, 4])
def test_what_stands_in_a_room_with_a_table_stands_on_it(number, bank):
    stood = 0
    for seed in SEEDS:
        scene = draw_scene(np.random.default_rng(seed), SETS[number], bank, seconds=0.3)
        top = next(part for part in scene.bodies[0].parts[2:] if part.shape == BOX)
        height = top.position[2] + top.half[2]
        for body in (body for body in scene.bodies if body.clutter):
            foot = min(part.position[2] - np.abs(part.rotation[2]) @ part.half for part in body.parts)
            if foot == pytest.approx(height, abs=1e-6):
                stood += 1
                middle = np.mean([part.position for part in body.parts], axis=0)
                assert np.all(np.abs(middle - top.position)[:2] < top.half[:2] + 0.2)
    assert stood > 10
