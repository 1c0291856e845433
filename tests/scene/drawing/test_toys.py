"""Toys: their size, their pieces, who has which kinds, and how large they are in a picture."""

import numpy as np
import pytest

from evimo.scene.bodies import BOX, CYLINDER, ELLIPSOID, Part, Surface
from evimo.scene.drawing.objects import size_of
from evimo.scene.drawing.paint import Paint
from evimo.scene.drawing.toys import KINDS, UNSEEN, drawn_kind, is_seen, outline, scaled, toy

GREY = Surface(0, 0.4, (0.0, 0.0), 0.1, 0.9)


@pytest.fixture(scope="module")
def paint(bank):
    return Paint(bank, 0.1, (1.3, 3.0), (0.08, 0.3), faint=0.0)


@pytest.mark.parametrize("kind", KINDS)
def test_a_toy_is_about_its_middle_and_as_long_as_asked(kind, paint):
    for seed in range(20):
        parts = scaled(toy(np.random.default_rng(seed), paint, kind), 0.2)
        assert size_of(parts).max() == pytest.approx(0.1, abs=0.005)
        assert min(part.half.min() for part in parts) >= 0.003
        low, high = (
            np.array([part.position + sign * np.abs(part.rotation) @ part.half for part in parts]) for sign in (-1, 1)
        )
        np.testing.assert_allclose(low.min(axis=0) + high.max(axis=0), 0, atol=0.005)


@pytest.mark.parametrize("kind", KINDS)
def test_the_pieces_of_a_toy_hang_together(kind, paint, within):
    """From every piece one gets to every other through boxes that touch."""
    parts = toy(np.random.default_rng(3), paint, kind)
    halves = [np.abs(part.rotation) @ part.half for part in parts]
    found, waiting = {0}, [0]
    while waiting:
        one = waiting.pop()
        for other in set(range(len(parts))) - found:
            apart = np.abs(parts[one].position - parts[other].position)
            if (apart <= halves[one] + halves[other] + 0.02).all():
                found.add(other)
                waiting.append(other)
    assert len(found) == len(parts)


def test_two_toys_of_a_kind_differ(paint):
    one, two = (toy(np.random.default_rng(seed), paint, "car") for seed in (1, 2))
    assert not np.allclose(one[0].half, two[0].half, rtol=0.01)


def test_some_kinds_are_in_the_test_part_alone():
    drawn = {
        part: {drawn_kind(part, None, np.random.default_rng(seed)) for seed in range(200)}
        for part in ("train", "test", None)
    }
    assert drawn["train"] == drawn[None] == set(KINDS) - set(UNSEEN)
    assert drawn["test"] == set(KINDS)
    assert all(is_seen(kind, "train") for kind in drawn["train"])
    assert {kind for kind in KINDS if not is_seen(kind, "test")} == set(UNSEEN)


@pytest.mark.parametrize(
    ("shape", "half", "way", "area"),
    [
        (BOX, (0.1, 0.05, 0.02), (0, 0, 1), 0.02),
        (BOX, (0.1, 0.05, 0.02), (1, 0, 0), 0.004),
        (ELLIPSOID, (0.1, 0.1, 0.1), (0, 0.6, 0.8), np.pi * 0.01),
        (CYLINDER, (0.1, 0.1, 0.2), (0, 0, 1), np.pi * 0.01),
        (CYLINDER, (0.1, 0.1, 0.2), (0, 1, 0), 0.08),
    ],
)
def test_outlines_by_hand(shape, half, way, area):
    part = Part(shape, np.array(half), np.array((0.3, 0.1, 0.0)), np.eye(3), GREY)
    assert outline((part,), np.array(way, float)) == pytest.approx(area, rel=0.12)
