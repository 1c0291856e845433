import numpy as np
import pytest

from evimo.classical.compensation import Parameters, compensate
from evimo.classical.world import Scene

BOX = (150.0, 80.0, 240.0, 160.0)


def halves(box: tuple[float, float, float, float], *, wider_px: float = 0.0) -> np.ndarray:
    """Which pixels of the map of half the picture lie in a box, or at most so far from it."""
    rows, columns = np.mgrid[:130, :173] * 2 + 0.5
    x0, y0, x1, y1 = np.add(box, (-wider_px, -wider_px, wider_px, wider_px))
    return (columns >= x0) & (columns <= x1) & (rows >= y0) & (rows <= y1)


@pytest.fixture
def found_and_bodies(scene_of, body):
    """A box of edges that moves against the wall behind it, as crowded as toys are."""
    wall = body((0.4, 0.1, 0.2, 0, 0, 0.3), edges=250, events=60_000)
    toy = body((-0.8, 0.4, 0, 0, 0, 0), edges=60, events=20_000, box=BOX)
    return compensate(scene_of(wall, toy), Parameters()), wall, toy


def test_what_moves_otherwise_is_found_where_it_is(found_and_bodies):
    found, _, _ = found_and_bodies
    moving = found.moving > 0.5
    assert moving[halves(BOX)].mean() > 0.6
    assert moving[~halves(BOX, wider_px=12)].mean() < 0.02


def test_flow_is_the_object_s_inside_and_the_wall_s_outside(found_and_bodies):
    found, wall, toy = found_and_bodies
    rows, columns = np.mgrid[:130, :173]
    points = np.column_stack((columns.ravel(), rows.ravel())) * 2 + 0.5
    for moved, where in (
        (toy, halves(BOX) & (found.moving > 0.5)),
        (wall, ~halves(BOX, wider_px=24) & (found.moving < 0.5)),
    ):
        true = moved.flow(points).T.reshape(2, 130, 173)
        error = np.hypot(*(found.flow - true))[where]
        assert np.median(error) < 1.0
    difference = (toy.flow(points) - wall.flow(points)).T.reshape(2, 130, 173)
    inside = halves(BOX) & (found.moving > 0.5)
    np.testing.assert_allclose(np.median(found.own_flow[:, inside], axis=1), difference[:, inside].mean(axis=1), atol=1)
    assert not found.own_flow[:, ~halves(BOX, wider_px=40) & (found.moving < 0.2)].any()


def test_confidence_is_where_events_are(found_and_bodies, scene_of, body):
    found, _, _ = found_and_bodies
    assert found.confidence.min() >= 0 and found.confidence.max() <= 1
    half = compensate(scene_of(body((0.5, 0, 0, 0, 0, 0), box=(0.0, 0.0, 150.0, 260.0)), noise=0), Parameters())
    assert half.confidence[:, :60].mean() > 0.3
    assert half.confidence[:, 120:].max() < 0.01


def test_a_wall_alone_does_not_move(scene_of, body):
    found = compensate(scene_of(body((0.5, -0.3, 0.3, 0, 0, 0.5), edges=250, events=60_000)), Parameters())
    assert (found.moving > 0.5).mean() < 0.03


def test_noise_and_silence_do_not_move():
    random = np.random.default_rng(0)
    for count in (0, 1, 5, 300):
        x, y, t = (random.uniform(low, high, count).astype(np.float32) for low, high in ((0, 345), (0, 259), (-1, 1)))
        found = compensate(Scene(x, y, t, (260, 346), (172.5, 129.5)), Parameters())
        assert not (found.moving > 0.5).any()
        assert not found.world.any() and not found.flow.any()
        assert all(np.isfinite(each).all() for each in found)


@pytest.mark.parametrize("size", [(1, 1), (3, 400), (24, 32), (121, 63)])
def test_any_size_of_picture_and_events_on_its_border(size):
    height, width = size
    random = np.random.default_rng(1)
    x, y = (
        random.choice([-0.5, 0.0, side - 1.0, side - 0.5 - 1e-3], 500).astype(np.float32) for side in (width, height)
    )
    scene = Scene(x, y, random.uniform(-1, 1, 500).astype(np.float32), size, (width / 2, height / 2))
    found = compensate(scene, Parameters())
    assert found.moving.shape == (-(-height // 2), -(-width // 2))
    assert np.isfinite(found.flow).all()
