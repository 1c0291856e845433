"""Movers and static clutter are one family: nothing but motion tells them apart."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import rankdata

from evimo.scene.bodies import GRATING
from evimo.scene.drawing.paint import Paint
from evimo.scene.drawing.rooms import furnished
from evimo.scene.drawing.scenes import SETS, draw_scene, viewpoint
from evimo.scene.drawing.space import Box, furniture
from evimo.scene.drawing.things import Family, draw_thing


@pytest.fixture(scope="module")
def scenes(bank):
    styles = list(SETS.values())
    return [draw_scene(np.random.default_rng((k, 8)), styles[k % 6], bank, seconds=0.3) for k in range(400)]


def standing(body):
    """Parts in the world, a mover's at its mean pose."""
    if body.motion is None:
        return body.parts
    return [
        replace(p, position=body.motion.position + body.motion.rotation @ p.position, rotation=p.rotation)
        for p in body.parts
    ]


def looks(body, scene):
    """What one picture tells of a body: size, place, contrast, brightness, pattern and shape."""
    parts = standing(body)
    seen = (np.array([p.position for p in parts]) - scene.camera.position) @ scene.camera.rotation
    size = np.linalg.norm(np.ptp(seen, axis=0)) + max(np.linalg.norm(p.half) for p in parts)
    middle = seen.mean(axis=0)
    distance = np.linalg.norm(middle)
    surfaces = [p.surface for p in parts]
    return [
        np.log(size),
        np.log(distance),
        np.log(size / distance),
        *middle / distance,
        len(parts),
        np.mean([np.log(s.bright / s.dark) for s in surfaces]),
        np.mean([np.log(s.bright) for s in surfaces]),
        np.mean([np.log(s.period) for s in surfaces]),
        np.mean([s.texture in scene.bank.plain for s in surfaces]),
        *np.bincount([p.shape for p in parts], minlength=5)[:3],
        len({s.texture for s in surfaces}),
    ]


def logistic(features, labels):
    """Weights of a regression, slightly held back."""

    def loss(weights):
        score = features @ weights[:-1] + weights[-1]
        return np.logaddexp(0, np.where(labels, -score, score)).mean() + 1e-3 * (weights**2).sum()

    return minimize(loss, np.zeros(features.shape[1] + 1)).x


def area_under_curve(scores, labels):
    ranks, ones = rankdata(scores), labels.sum()
    return (ranks[labels].sum() - ones * (ones + 1) / 2) / (ones * (len(labels) - ones))


def told_apart(ones, others):
    """How well half of both, regressed on, tells the other half apart: 0.5 is not at all, 1 is always."""
    features = np.array([*ones, *others])
    labels = np.arange(len(features)) < len(ones)
    features = (features - features.mean(axis=0)) / (features.std(axis=0) + 1e-9)
    learnt = np.random.default_rng(0).random(len(labels)) < 0.5
    weights = logistic(features[learnt], labels[learnt])
    return area_under_curve(features[~learnt] @ weights[:-1], labels[~learnt])


def test_one_picture_does_not_tell_movers_from_clutter(scenes):
    movers = [looks(body, scene) for scene in scenes for body in scene.movers]
    clutter = [looks(body, scene) for scene in scenes for body in scene.bodies if body.clutter]
    assert told_apart(movers, clutter) < 0.6


def corners(parts):
    """Lowest and highest corner of what a body is, without what carries it."""
    half = [np.abs(part.rotation) @ part.half for part in parts]
    low = np.min([part.position - h for part, h in zip(parts, half, strict=True)], axis=0)
    return low, np.max([part.position + h for part, h in zip(parts, half, strict=True)], axis=0)


@pytest.mark.parametrize("room", ["boxes", "floor", "wall", "table", "tabletop"])
def test_things_are_drawn_into_nothing_else_if_there_is_room(bank, room):
    """Boxes around things overlap neither each other nor furniture in all but few of them."""
    meets, things = 0, 0
    for seed in range(12):
        rng = np.random.default_rng((seed, 4))
        family = Family(Paint(bank, 0.5, (1, 2), (0.1, 0.5)))
        furnished_room = furnished(rng, room, family.paint)
        view = viewpoint(rng, room, furnished_room)
        taken, boxes = furniture(furnished_room), []
        for _ in range(7):
            thing = draw_thing(rng, family, view, taken)
            taken.append(Box(thing.at, thing.half))
            low, high = corners([replace(p, position=p.position + thing.at) for p in thing.parts[: thing.own]])
            solid = [p for p in furnished_room.parts if not p.inside and p.shape != GRATING and p.position[2] > 0]
            around = [corners([part]) for part in solid] + boxes
            meets += any(((low + 0.03 < b) & (a < high - 0.03)).all() for a, b in around)
            boxes.append((low, high))
            things += 1
    assert meets / things < 0.08  # 0.15 and more were places not looked for


def test_nothing_fills_the_picture_where_it_is_meant_to_be(scenes):
    """The scene's things, seen from the camera's mean place, span at most about half of its width."""
    spans = []
    for scene in scenes[:150]:
        for body in scene.movers:
            parts = [part for part in standing(body) if np.linalg.norm(part.position - body.motion.position) < 0.3]
            depth = ((body.motion.position - scene.camera.position) @ scene.camera.rotation)[2]
            spans.append(max(np.linalg.norm(part.half) for part in parts if max(part.half) < 0.2) / depth)
    assert np.quantile(spans, 0.98) < 0.7


def test_the_measure_tells_what_differs(scenes):
    movers = [looks(body, scene) for scene in scenes for body in scene.movers]
    rooms = [
        looks(replace(scene.bodies[0], parts=(part,)), scene) for scene in scenes for part in scene.bodies[0].parts
    ]
    assert told_apart(movers, rooms) > 0.9
