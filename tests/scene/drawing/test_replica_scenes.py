"""Scenes of the replica's population: how large, near and fast toys are, and how many there are."""

import numpy as np
import pytest

from evimo.recordings.flow import true_flow
from evimo.scene.drawing.replica import draw_replica_scene
from evimo.scene.drawing.scenes import SETS
from evimo.scene.drawing.toys import KINDS, UNSEEN
from evimo.scene.renderer import Renderer
from evimo.simulate.cameras import EVIMO

SECONDS = 0.5
SLICE_PX = 40 / 258.0


@pytest.fixture(scope="module")
def scenes(bank):
    return [
        draw_replica_scene(np.random.default_rng((7, k)), SETS[k % 6 + 1], bank, seconds=SECONDS, part="test")
        for k in range(90)
    ]


@pytest.fixture(scope="module")
def looks(scenes):
    """Of each mover in view in the middle: share of the picture, depth, motion against the camera's in px per slice."""
    camera, found = EVIMO.resized(65, 87), []
    grid = np.moveaxis(camera.normalised(camera.pixels())[0], -1, 0)
    x, y = grid
    for scene in scenes[:60]:
        truth = Renderer(scene, camera).truth(250_000)
        inverse = np.where(truth.valid, 1 / np.maximum(truth.depth, 1e-3), 0)
        vx, vy, vz, wx, wy, wz = truth.ego
        u = inverse * (x * vz - vx) + x * y * wx - (1 + x * x) * wy + y * wz
        v = inverse * (y * vz - vy) + (1 + y * y) * wx - x * y * wy - x * wz
        residual = np.hypot(*(true_flow(truth, grid) - np.stack((u, v)))) / SLICE_PX
        for number in truth.objects:
            seen = (truth.ids == number) & truth.valid
            if seen.mean() > 0.001:
                found.append((seen.mean(), np.median(truth.depth[seen]), np.median(residual[seen])))
    return np.array(found).T


def test_toys_cover_a_few_hundredths_of_the_picture(looks):
    low, middle, high = np.quantile(looks[0], [0.25, 0.5, 0.75])
    assert 0.009 < low < middle < high < 0.04


def test_toys_are_within_reach_of_the_camera(looks):
    low, high = np.quantile(looks[1], [0.05, 0.95])
    assert 0.35 < low < high < 2.2


def test_toys_move_some_pixels_per_slice_against_the_camera(looks):
    low, high = np.quantile(looks[2], [0.25, 0.75])
    assert 2 < low < high < 8


def test_nothing_rests_for_longer_than_a_moment(scenes):
    for motion in (body.motion for scene in scenes for body in scene.movers):
        speed = np.linalg.norm(motion.at(np.linspace(0, SECONDS, 50)).velocity, axis=1)
        assert (speed < 0.03).mean() < 0.1


def test_movers_are_toys_of_one_kind_and_as_many_as_the_set_says(scenes):
    for k, scene in enumerate(scenes):
        assert len(scene.movers) in SETS[k % 6 + 1].movers
        assert {body.kind for body in scene.movers} <= set(KINDS)
    assert {body.kind for scene in scenes for body in scene.movers} == set(KINDS)


def test_some_training_scenes_are_empty_and_none_has_unseen_kinds(bank):
    drawn = [
        draw_replica_scene(np.random.default_rng(k), SETS[4], bank, seconds=SECONDS, part="train", empty=0.2)
        for k in range(80)
    ]
    assert 0.08 < np.mean([not scene.movers for scene in drawn]) < 0.35
    assert not {body.kind for scene in drawn for body in scene.bodies} & set(UNSEEN)


def test_toys_stand_about_among_boxes_and_on_tabletops_alone(scenes):
    standing = {scene.room: 0 for scene in scenes}
    for scene in scenes:
        standing[scene.room] = max(standing[scene.room], sum(body.clutter for body in scene.bodies))
    assert standing["boxes"] >= 2
    assert standing["tabletop"] >= 2
    assert max(standing.values()) <= 4
    assert standing["floor"] == standing["wall"] == standing["table"] == 0


def test_what_moves_in_a_long_scene_stays_near_its_place(bank):
    times = np.linspace(0, 60, 600)
    for k in range(18):
        scene = draw_replica_scene(np.random.default_rng((9, k)), SETS[k % 6 + 1], bank, seconds=60, part="test")
        for motion in (body.motion for body in scene.movers):
            way = motion.at(times).position
            assert np.linalg.norm(way - way.mean(axis=0), axis=1).max() < 1.2
