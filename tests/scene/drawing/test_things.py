"""Movers and static clutter are one family: nothing but motion tells them apart."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import rankdata

from evimo.scene.bodies import GRATING
from evimo.scene.drawing.paint import Paint
from evimo.scene.drawing.rooms import furnished
from evimo.scene.drawing.scenes import SETS, draw_scene, viewpoint
from evimo.scene.drawing.space import Box, boxes_of
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


def sticking_in_others(bank, within, *, look):
    """Share of things, in all kinds of rooms, of which a fiftieth is inside another thing or furniture."""
    dice, stuck = np.random.default_rng(0).uniform(-0.9, 0.9, (60, 3)), []
    for kind, seed in product(("boxes", "floor", "wall", "table", "tabletop"), range(12)):
        rng = np.random.default_rng((seed, 4))
        family = Family(Paint(bank, 0.5, (1, 2), (0.1, 0.5)))
        room = furnished(rng, kind, family.paint)
        view = viewpoint(rng, kind, room)
        taken, solid = boxes_of(room), [part for part in room.parts if not part.inside and part.shape != GRATING]
        for _ in range(7):
            thing = draw_thing(rng, family, view, taken if look else ())
            own = thing.placed()[: thing.own]
            points = np.concatenate([part.position + (dice * part.half) @ part.rotation.T for part in own])
            stuck.append(any(within(part, points).mean() > 0.02 for part in solid))
            taken.append(Box(thing.at, thing.half))
            solid += own
    return np.mean(stuck)


def test_things_are_drawn_into_nothing_else_where_there_is_room(bank, within):
    assert sticking_in_others(bank, within, look=True) < 0.03
    assert sticking_in_others(bank, within, look=False) > 0.1


def test_the_measure_tells_what_differs(scenes):
    movers = [looks(body, scene) for scene in scenes for body in scene.movers]
    rooms = [
        looks(replace(scene.bodies[0], parts=(part,)), scene) for scene in scenes for part in scene.bodies[0].parts
    ]
    assert told_apart(movers, rooms) > 0.9
