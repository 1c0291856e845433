import numpy as np
import pytest

from evimo.scene.bodies import CYLINDER
from evimo.scene.drawing.carriers import CARRIERS, frame_along
from evimo.scene.drawing.objects import compound
from evimo.scene.drawing.paint import Paint
from evimo.scene.drawing.pools import family
from evimo.scene.drawing.rooms import furnished
from evimo.scene.drawing.scenes import SETS, draw_scene
from evimo.scene.drawing.things import Family, View, draw_thing


@pytest.fixture(scope="module")
def view(bank):
    room = furnished(np.random.default_rng(0), "floor", Paint(bank, 0.5, (0.5, 2), (0.3, 1)))
    looks = np.array([[1.0, 0, 0], [0, -0.6, 0.8], [0, -0.8, -0.6]])  # down to the floor, forward
    return View(room, np.array([0.0, -0.8, 1.2]), looks, 1.4)


@pytest.fixture(scope="module")
def things(view, bank):
    rng = np.random.default_rng(1)
    paint = Family(Paint(bank, 0.5, (0.5, 2), (0.1, 0.5)))
    return [draw_thing(rng, paint, view) for _ in range(300)]


def carried(things, how):
    return [thing for thing in things if thing.how == how]


def test_every_carrier_is_drawn_as_often_as_meant(things):
    for how, share in CARRIERS.items():
        assert len(carried(things, how)) / len(things) == pytest.approx(share, abs=0.07)


def test_families_of_shapes_do_not_depend_on_carriers(things):
    for thing in things:
        odd = [sum(family(part.shape for part in parts)[1:]) % 2 for parts in (thing.parts, thing.parts[: thing.own])]
        assert odd[0] == odd[1]


def test_what_does_not_stand_fills_at_most_half_of_the_width_where_it_is_meant_to_be(things, view):
    """Of the picture of EV-IMO's camera: 346 px wide, f = 257.68 px."""
    for thing in things:
        if thing.how not in ("floor", "legs"):
            depth = (thing.at - view.position) @ view.axes[:, 2]
            assert 2 * thing.half.max() / depth * 257.68 < 0.51 * 346


def test_most_of_what_stands_is_in_the_picture(things, view):
    x, y, z = np.array([(t.at - view.position) @ view.axes for t in things if t.how in ("floor", "legs")]).T
    assert np.mean((np.abs(x / z) < 0.67) & (np.abs(y / z) < 0.5) & (z > 0.2)) > 0.8


def test_arms_leave_the_picture(things, view):
    for thing in carried(things, "hand"):
        sleeve = thing.placed()[-1]
        ends = [sleeve.position + sign * sleeve.half[2] * sleeve.rotation[:, 2] for sign in (-1, 1)]
        x, y, z = ((ends[1] if thing.own else ends[0]) - view.position) @ view.axes
        assert z < 0.1 or abs(x / z) > 0.7 or abs(y / z) > 0.52


def test_hands_touch_what_they_hold(things):
    for thing in carried(things, "hand"):
        own = np.array([part.position for part in thing.parts[: thing.own]])
        reach = max(np.linalg.norm(part.half) for part in thing.parts[: thing.own])
        palm = thing.parts[thing.own].position
        assert np.linalg.norm(own - palm, axis=1).min() < reach + 0.05


def test_sticks_are_thin_and_go_from_the_thing_out_of_the_picture(things, view):
    for thing in carried(things, "stick"):
        rod = thing.placed()[thing.own]
        tip, grip = (rod.position + sign * rod.half[2] * rod.rotation[:, 2] for sign in (-1, 1))
        own = thing.placed()[: thing.own]
        assert min(np.linalg.norm(tip - part.position) for part in own) < 1e-9
        assert rod.half[0] < 0.01
        x, y, z = (grip - view.position) @ view.axes
        assert z < 0.1 or abs(x / z) > 0.7 or abs(y / z) > 0.52


def test_strings_end_at_the_ceiling(things, view):
    hanging = carried(things, "string")
    for thing in hanging:
        string = thing.placed()[thing.own]
        assert string.position[2] + string.half[2] == pytest.approx(2 * view.room.half[2])
        assert string.half[0] < 0.005
        assert thing.string == pytest.approx(2 * view.room.half[2] - thing.at[2])


def test_legs_are_thin_and_stand_on_the_floor(things):
    for thing in carried(things, "legs"):
        for leg in thing.placed()[thing.own :]:
            assert leg.shape == CYLINDER
            assert leg.half[0] <= 0.01
            assert leg.position[2] - leg.half[2] == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("axis", range(3))
def test_a_frame_has_the_asked_axis_and_is_a_rotation(axis):
    way = np.eye(3)[axis]
    frame = frame_along(np.random.default_rng(2), way)
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1)
    np.testing.assert_allclose(frame[:, 2], way)


def test_clutter_is_carried_as_movers_are(bank):
    """Hands and strings alone say nothing: as large a share of clutter has more parts than a compound may."""
    drawn = [draw_scene(np.random.default_rng(k), SETS[2], bank, seconds=0.3) for k in range(200)]
    bodies = [body for scene in drawn for body in scene.bodies[1:]]
    many = {clutter: np.mean([len(b.parts) > 5 for b in bodies if b.clutter == clutter]) for clutter in (True, False)}
    assert many[True] == pytest.approx(many[False], abs=0.06)
    assert many[True] > 0.15


def test_compounds_of_a_bank_without_meshes_have_none(bank):
    paint = Paint(bank, 0.5, (0.5, 2), (0.1, 0.5))
    assert all(part.mesh < 0 for k in range(20) for part in compound(np.random.default_rng(k), paint))
