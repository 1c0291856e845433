"""A calibration that is some pixels and milliseconds wrong is put right by the outlines of balls and their events.

Events are made from the circle along which rays touch a ball, which is another road than a renderer's pixels.
"""

import numpy as np
import pytest

from evimo.calibrating.contours import Rendered, outline_points, straightened
from evimo.calibrating.edges import event_density, refine_by_edges
from evimo.calibrating.fitting import Calibration
from evimo.calibrating.outline_fit import Shifts
from evimo.calibrating.rigid import angle_between, inverse, moved, nudged, pose
from evimo.calibrating.world import Moment, World
from evimo.errors import BadInput
from evimo.events.events import Events
from evimo.geometry.camera import Camera

PINHOLE = Camera(50.0, 50.0, 31.5, 23.5, 48, 64)
BALL = 1  # the body that moves; the others belong to the room


class Balls:
    """Balls in a room of which nothing is known, one of them moving, and a hand-held rig."""

    def __init__(self, known, rng, count=7):
        self.known = known
        self.centres = rng.uniform((-1.4, -1.1, 0.9), (1.4, 1.1, 2.6), (count, 3))  # axes of the first camera
        self.radii = rng.uniform(0.05, 0.16, count)
        start = self.rig(np.zeros(1))[0] @ known.rig_from_cam
        self.centres = moved(start, self.centres)

    def rig(self, t_s):
        turn = np.stack((0.25 * np.sin(2.1 * t_s), 0.25 * np.cos(1.7 * t_s), 0.5 * np.sin(1.4 * t_s)), axis=-1)
        place = np.stack((0.25 * np.sin(1.9 * t_s), 0.15 * np.cos(2.9 * t_s), 0.2 * np.sin(1.3 * t_s)), axis=-1)
        return pose(self.known.rotations(turn), place)

    def ball(self, t_s):
        """The moving ball: the first one, carried about."""
        place = np.stack((0.3 * np.sin(3 * t_s), 0.3 * np.cos(2.3 * t_s), 0.1 * np.sin(t_s)), axis=-1)
        return pose(self.known.rotations(np.zeros_like(place)), place)

    def placed(self, t_s):
        centres = self.centres.copy()
        centres[0] = moved(self.ball(np.array([t_s]))[0], centres[:1])[0]
        return centres

    def render(self, camera):
        straight, valid = camera.normalised(camera.pixels())
        rays = np.concatenate((straight, np.ones((*camera.size, 1))), axis=2)
        squared = (rays**2).sum(axis=2)

        def drawn(time_us, world_from_cam):
            depth, ids = np.full(camera.size, np.inf), np.zeros(camera.size, np.uint8)
            centres = moved(inverse(world_from_cam), self.placed(time_us / 1e6))
            for number, (centre, radius) in enumerate(zip(centres, self.radii, strict=True)):
                along = rays @ centre
                room = along**2 - squared * (centre @ centre - radius**2)
                near = (along - np.sqrt(np.maximum(room, 0))) / squared
                hit = valid & (room > 0) & (near > 0) & (near < depth)
                depth[hit], ids[hit] = near[hit], BALL if number == 0 else 0
            return Rendered(np.where(np.isfinite(depth), depth, 0), ids, np.isfinite(depth))

        return drawn

    def events(self, rng, time_us, half_us=6000, each=160, stray=600):
        """Events around a time of the camera's clock: on outlines, and anywhere."""
        found = []
        for t_us in np.sort(rng.uniform(time_us - half_us, time_us + half_us, 20)):
            t_s = (t_us - self.known.offset_us) / 1e6
            cam_from_world = inverse(self.rig(np.array([t_s]))[0] @ self.known.rig_from_cam)
            centres = moved(cam_from_world, self.placed(t_s))
            points = [rim(rng, *ball, each // 20) for ball in zip(centres, self.radii, strict=True) if ball[0][2] > 0.3]
            px = self.known.pixels(np.concatenate(points)) + rng.normal(0, 0.5, (sum(map(len, points)), 2))
            anywhere = rng.uniform(
                -0.5, (self.known.camera.width - 0.5, self.known.camera.height - 0.5), (stray // 20, 2)
            )
            px = np.rint(np.concatenate((px, anywhere)))
            px = px[((px >= 0) & (px <= (self.known.camera.width - 1, self.known.camera.height - 1))).all(axis=1)]
            found.append(np.concatenate((px, np.full((len(px), 1), t_us)), axis=1))
        x, y, t = np.concatenate(found).T
        p = rng.choice((-1, 1), len(t))
        return Moment(Events(x.astype(np.uint16), y.astype(np.uint16), t.astype(np.int64), p.astype(np.int8)))


def rim(rng, centre, radius, count):
    """Points of the circle along which rays from the origin touch a ball."""
    far = np.linalg.norm(centre)
    way = centre / far
    across = np.linalg.svd(way[None])[2][1:]
    angle = rng.uniform(0, 2 * np.pi, count)
    circle = np.cos(angle)[:, None] * across[0] + np.sin(angle)[:, None] * across[1]
    return centre * (1 - radius**2 / far**2) + circle * radius * np.sqrt(1 - radius**2 / far**2)


def exactly(path):
    """Mocap without noise, that knows everything."""
    return lambda times_us: (path(np.asarray(times_us) / 1e6), np.ones(len(times_us), np.bool_))


@pytest.fixture
def balls(known):
    return Balls(known, np.random.default_rng(5))


def test_a_wrong_calibration_is_put_right(known, balls):
    rng = np.random.default_rng(6)
    moments = [balls.events(rng, time_us) for time_us in np.linspace(0.3e6, 7.7e6, 12)]
    world = World(exactly(balls.rig), {BALL: exactly(balls.ball)}, balls.render(known.camera))
    wrong = nudged(known.rig_from_cam, np.array((0.001, -0.002, 0.001, 0.012, -0.008, 0.01)))
    start = Calibration(
        camera=known.camera, rig_from_cam=wrong, body_from_target=np.eye(4), offset_us=known.offset_us - 9_000
    )
    fit = refine_by_edges(start, moments, world)
    made = fit.calibration
    assert np.linalg.norm(made.rig_from_cam[:3, 3] - known.rig_from_cam[:3, 3]) < 0.003
    assert np.degrees(angle_between(made.rig_from_cam, known.rig_from_cam)) < 0.1
    assert abs(made.offset_us - known.offset_us) < 300
    assert fit.after > fit.before + 0.05


def test_outlines_run_between_the_near_and_the_far_at_the_nears_depth():
    depth = np.full(PINHOLE.size, 2.0)
    depth[10:20, 30:40] = 1.0
    depth[12:18, 32:38] = 0.99  # a slope, no outline
    valid = np.ones(PINHOLE.size, np.bool_)
    valid[:, :5] = False
    ids = np.where(depth < 1.5, BALL, 0)
    found = outline_points(Rendered(depth, ids, valid), PINHOLE, margin=0)
    points, px, of_ball = found.points, found.px, found.body == BALL
    assert of_ball.sum() == 40 and np.allclose(points[of_ball, 2], 1.0)
    assert {tuple(each) for each in px[of_ball].tolist()} >= {(29.5, 10.0), (39.5, 19.0), (30.0, 9.5), (39.0, 19.5)}
    assert (~of_ball).sum() == 48 and np.allclose(px[~of_ball, 0], 4.5)  # what is unknown lies behind
    assert np.allclose(found.outward[~of_ball], (-1, 0))
    assert np.allclose(PINHOLE.project(points[:, :2] / points[:, 2:]), px)
    assert outline_points(Rendered(depth, ids, valid), PINHOLE, margin=12).px.min() >= 12


def test_an_oblique_plane_has_no_outline():
    x, y = np.meshgrid(np.arange(64), np.arange(48))
    depth = 1 / (0.02 + 0.02 * y + 0.005 * x)  # from pixel to pixel it changes by half
    everything = np.ones(PINHOLE.size, np.bool_)
    found = outline_points(Rendered(depth, np.zeros(PINHOLE.size, np.int64), everything), PINHOLE, margin=0)
    assert not len(found.px)


def test_slanted_outlines_are_straightened():
    x, y = np.meshgrid(np.arange(64), np.arange(48))
    normal, far = np.array((0.6, 0.8)), 31.3  # the near side's outer normal, and the outline's distance from (0, 0)
    depth = np.where(0.6 * x + 0.8 * y < far, 1.0, 2.0)
    seen = Rendered(depth, np.zeros(PINHOLE.size, np.int64), np.ones(PINHOLE.size, np.bool_))
    raw = outline_points(seen, PINHOLE, margin=3)
    found = straightened(raw, PINHOLE)
    assert len(found.px) > 0.8 * len(raw.px)
    assert np.abs(found.px @ normal - far).mean() < 0.6 * np.abs(raw.px @ normal - far).mean()
    assert (found.outward @ normal).min() > 0.97
    assert np.allclose(PINHOLE.project(found.points[:, :2] / found.points[:, 2:]), found.px)


def test_events_are_dense_on_a_line_and_even_in_a_crowd():
    line, crowd = np.zeros((60, 80)), np.ones((60, 80))
    line[:, 40] = 3
    assert event_density(line, 1.5)[30, 40] > 0.6
    assert event_density(line, 1.5)[30, 10] < 0.01
    assert event_density(crowd, 1.5)[30, 40] == pytest.approx(1 / 2.25, abs=0.01)


def test_a_result_that_lies_on_texture_is_an_error(known, balls, monkeypatch):
    rng = np.random.default_rng(6)
    moments = [balls.events(rng, time_us) for time_us in np.linspace(0.3e6, 7.7e6, 12)]
    world = World(exactly(balls.rig), {BALL: exactly(balls.ball)}, balls.render(known.camera))
    start = Calibration(
        camera=known.camera, rig_from_cam=known.rig_from_cam, body_from_target=np.eye(4), offset_us=known.offset_us
    )
    on_texture = Shifts(0.0, -0.6, 0.2, 0.3, 0.0)
    monkeypatch.setattr("evimo.calibrating.edges.fit_outlines", lambda *_: (np.zeros(7), on_texture))
    with pytest.raises(BadInput, match="texture hides them"):
        refine_by_edges(start, moments, world)


def test_nothing_in_view_is_an_error(known, balls):
    nothing = np.zeros(known.camera.size, np.int64)
    nowhere = World(exactly(balls.rig), {}, lambda *_: Rendered(nothing.astype(float), nothing, nothing > 0))
    start = Calibration(camera=known.camera, rig_from_cam=known.rig_from_cam, body_from_target=np.eye(4), offset_us=0.0)
    with pytest.raises(BadInput, match="0 points of outlines"):
        refine_by_edges(start, [balls.events(np.random.default_rng(1), 1e6)], nowhere)
