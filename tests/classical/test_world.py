import numpy as np
import pytest

from evimo.classical.compensation import Parameters, world_and_misfit
from evimo.classical.regions import flow_of
from evimo.classical.sharpness import warp_back
from evimo.classical.world import Scene, fine_motion, shared

POINTS = np.array([[40.0, 40.0], [300.0, 40.0], [40.0, 220.0], [300.0, 220.0], [172.5, 129.5]])


def flow_at(motion: np.ndarray, scene: Scene) -> np.ndarray:
    """Px per slice of a motion at POINTS, (5, 2): how far it carries an event of one slice later back."""
    x, y = POINTS.T.astype(np.float32)
    back = np.empty((2, len(x)), np.float32)
    warp_back(x, y, np.ones(len(x), np.float32), motion, scene.centre, back)
    return POINTS - back.T


# Of the camera, relative to a wall at distance 1: shifts, approach, turn about the optical axis, and all of them.
TWISTS = [
    (0.8, 0, 0, 0, 0, 0),
    (0, -0.5, 0, 0, 0, 0),
    (0, 0, 1.0, 0, 0, 0),
    (0, 0, 0, 0, 0, 1.5),
    (0.5, -0.4, 0.5, 0, 0, -1.0),
]


@pytest.mark.parametrize("twist", TWISTS, ids=["right", "up", "forward", "turn", "all"])
def test_the_motion_before_a_wall_is_that_of_its_points(scene_of, body, twist):
    wall = body(twist, edges=200, events=50_000)
    motion, _ = world_and_misfit(scene_of(wall), Parameters())
    assert np.linalg.norm(flow_at(motion, scene_of(wall)) - wall.flow(POINTS), axis=1).max() < 1.0


@pytest.mark.parametrize("seed", range(5))
def test_a_crowded_object_over_a_third_of_the_picture_is_not_taken_for_the_world(scene_of, body, seed):
    """It has more events than all the wall that is left."""
    wall = body((0.4, 0.2, 0, 0, 0, 0.4), edges=250, events=60_000)
    toy = body((-0.9, 0.3, 0, 0, 0, 0), edges=70, events=50_000, box=(120.0, 30.0, 300.0, 200.0))
    scene = scene_of(wall, toy, seed=seed)
    motion, _ = world_and_misfit(scene, Parameters())
    assert np.linalg.norm(flow_at(motion, scene) - wall.flow(POINTS), axis=1).max() < 1.0


@pytest.mark.parametrize("noise", [0, 500, 1500])
def test_a_resting_camera_rests_whatever_moves_before_it(scene_of, body, noise):
    """All events but noise, up to 0.3 per pixel and second, are the object's."""
    toy = body((-0.5, 0.3, 0, 0, 0, 0), edges=15, events=6000, box=(150.0, 100.0, 210.0, 160.0))
    motion, _ = world_and_misfit(scene_of(toy, noise=noise), Parameters())
    assert not motion.any()


SLOW = [(0.1, -0.05, 0, 0, 0, 0), (-0.06, 0.1, 0, 0, 0, 0.1), (0, 0, 0.2, 0, 0, 0), (0, 0, 0, 0, 0, -0.2)]


@pytest.mark.parametrize("edges", [80, 200])
@pytest.mark.parametrize("twist", SLOW, ids=["right", "down", "forward", "turn"])
def test_a_slow_camera_does_not_rest(scene_of, body, twist, edges):
    """Points move by up to 0.7 px per slice, on edges that leave most of the picture bare, or cover it."""
    wall = body(twist, edges=edges, events=20_000)
    true = wall.flow(POINTS)
    assert 0.4 < np.linalg.norm(true, axis=1).max() < 1.2
    for seed in range(3):
        scene = scene_of(wall, seed=seed)
        motion, _ = world_and_misfit(scene, Parameters())
        error = np.linalg.norm(flow_at(motion, scene) - true, axis=1)
        assert error.mean() < 0.75 * np.linalg.norm(true, axis=1).mean()


def test_a_slow_camera_does_not_rest_behind_an_object(scene_of, body):
    """The object has as many events as the wall and moves ten times as far."""
    wall = body((0.12, 0, 0, 0, 0, 0), edges=150, events=9000)
    toy = body((-1.2, 0.3, 0, 0, 0, 0), edges=20, events=9000, box=(150.0, 100.0, 210.0, 160.0))
    motion, _ = world_and_misfit(scene_of(wall, toy), Parameters())
    assert np.linalg.norm(flow_at(motion, scene_of(wall, toy)) - wall.flow(POINTS), axis=1).max() < 0.6


def test_a_motion_is_shared_by_the_picture_that_follows_it_alone(scene_of, body):
    """Of a wall its own motion is, and half of it; the opposite, rest, and the motion of a few places are not."""
    wall = scene_of(body((0.4, 0, 0, 0, 0, 0), edges=150))
    true = np.array([-0.4 * 260 * 0.025, 0, 0, 0])
    most = Parameters().majority
    assert min(shared(wall, true), shared(wall, true / 2)) > 2 * most
    assert shared(wall, -true) == pytest.approx(-shared(wall, true))
    assert shared(wall, np.zeros(4)) == 0
    few = scene_of(body((0.4, 0, 0, 0, 0, 0), edges=15, box=(150.0, 100.0, 230.0, 180.0)))
    assert 0.02 < shared(few, true) < most


@pytest.mark.parametrize("count", [0, 1, 30])
def test_few_events_say_nothing_of_motion(count):
    random = np.random.default_rng(0)
    x, y, t = (random.uniform(low, high, count).astype(np.float32) for low, high in ((0, 345), (0, 259), (-1, 1)))
    motion, _ = world_and_misfit(Scene(x, y, t, (260, 346), (172.5, 129.5)), Parameters())
    assert not motion.any()


def test_events_without_a_share_have_no_say(scene_of, body):
    """A second motion over the whole picture, as strong as the first, changes nothing once its share is 0."""
    first, second = body((0.5, 0, 0, 0, 0, 0)), body((-0.5, 0, 0, 0, 0, 0))
    alone, other = scene_of(first, noise=0), scene_of(second, noise=0, seed=1)
    both = Scene(*(np.concatenate((getattr(alone, k), getattr(other, k))) for k in "xyt"), alone.size, alone.centre)
    share = (np.arange(len(both.t)) < len(alone.t)).astype(np.float32)
    motion = fine_motion(both, share, np.array([-2.0, 0.5, 0, 0]))
    assert np.linalg.norm(flow_at(motion, both) - first.flow(POINTS), axis=1).max() < 1.0


def test_thinning_keeps_events_of_the_whole_window(scene_of, body):
    scene = scene_of(body((0.5, 0, 0, 0, 0, 0)))
    few = scene.thinned(1000)
    assert 500 < len(few.t) <= 1000
    assert few.t.min() < -0.95 and few.t.max() > 0.95
    assert len(scene.thinned(10**9).t) == len(scene.t)


def test_a_map_of_motions_holds_the_flow_of_each():
    """Every pixel's flow is how far its middle moves: half the picture's pixels lie between four of the picture's."""
    motions = np.array([[1.0, -2.0, 0.5, 0.3], [-3.0, 0.0, -0.2, 0.8]])
    numbers = np.zeros((130, 173), np.uint8)
    numbers[40:, 60:] = 1
    flow = flow_of(motions, numbers, (172.5, 129.5))
    for row, column in ((3, 5), (100, 120)):
        x, y = np.array([2 * column + 0.5], np.float32), np.array([2 * row + 0.5], np.float32)
        back = np.empty((2, 1), np.float32)
        warp_back(x, y, np.ones(1, np.float32), motions[numbers[row, column]], (172.5, 129.5), back)
        np.testing.assert_allclose(flow[:, row, column], (x[0] - back[0, 0], y[0] - back[1, 0]), atol=1e-4)
