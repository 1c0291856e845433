"""Soft shadows against a lamp of many small lights, each of them hidden or not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_erosion

from evimo.geometry.camera import Camera
from evimo.scene.bodies import BOX, ELLIPSOID, Body, Part, Scene, Surface
from evimo.scene.motion import Motion
from evimo.scene.rays.shadows import hidden_share, may_shade, shadow_rows
from evimo.scene.renderer import Renderer, lens_rays

NOW = np.array([0.0])
CAMERA = Camera(fx=80.0, fy=80.0, cx=69.5, cy=59.5, height=120, width=140, distortion=(0.0, 0.0, 0.0, 0.0))
LAMP = 0.12
LIGHT = np.array([-0.7, -0.4, -1.0]) / np.linalg.norm([-0.7, -0.4, -1.0])  # from behind the camera, onto the wall
WALL_M = 3.0
BALLS = ((0.1, (0.1, 0.45, 2.2)), (0.25, (-0.3, -0.5, 2.4)), (0.15, (-0.9, 0.4, 2.6)))  # radius, centre


def grey(**how: float) -> Surface:
    return Surface(0, 1.0, (0.0, 0.0), 0.5, 0.5, **how)


def room(*, gloss: float = 0.0) -> Body:
    return Body((Part(BOX, np.array((4.0, 4.0, WALL_M)), np.zeros(3), np.eye(3), grey(gloss=gloss), inside=True),))


def ball(radius: float, at: tuple[float, ...], stretch: tuple[float, ...] = (1.0, 1.0, 1.0)) -> Body:
    part = Part(ELLIPSOID, radius * np.array(stretch), np.array(at), np.eye(3), grey())
    return Body((part,), clutter=True)


def seen(bank, *bodies: Body, lamp: float = LAMP, ambient: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Irradiance, depth and part (H, W) from the origin along z."""
    scene = Scene(bodies, Motion(np.zeros(3), np.eye(3)), LIGHT, ambient, bank, lamp=lamp)
    frames = Renderer(scene, CAMERA).frames(NOW)
    return frames.image[0], *frames.seen(0)


def lamp_seen_from(points: np.ndarray, centre: np.ndarray, half: np.ndarray, lights: int) -> np.ndarray:
    """Share (N,) of small lights, spread evenly over the lamp's disc, that an ellipsoid does not hide."""
    k = np.arange(lights) + 0.5
    out, turn = np.tan(LAMP) * np.sqrt(k / lights), 2.399963 * k
    side = np.cross(LIGHT, (0, 1, 0)) / np.linalg.norm(np.cross(LIGHT, (0, 1, 0)))
    ways = LIGHT + out[:, None] * (np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * np.cross(LIGHT, side))
    at, ways = (points[:, None] - centre) / half, ways / half
    b, a, c = (at * ways).sum(-1), (ways**2).sum(-1), (at**2).sum(-1) - 1
    return ((b * b - a * c < 0) | (b > 0)).mean(axis=1)


def shadow_on_wall(bank, *things: Body) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Share of light (H, W) left behind things, where only the wall is seen (H, W), and points (H, W, 3)."""
    lit, _, _ = seen(bank, room(), *things, lamp=0.0)
    shaded, depth, part = seen(bank, room(), *things)
    on_wall = binary_erosion((part == 0) & (np.abs(depth - WALL_M) < 1e-3))  # edges are mixed with what is beside them
    return shaded / lit, on_wall, wall_points(depth)


@pytest.fixture(scope="module")
def wall(bank):
    return shadow_on_wall(bank, *(ball(*each) for each in BALLS))


def wall_points(depth: np.ndarray) -> np.ndarray:
    rays = lens_rays(CAMERA)[0][0].astype(float)
    return np.stack((*rays, np.ones_like(rays[0])), axis=-1) * depth[..., None]


def test_shadows_are_those_of_many_small_lights(wall):
    share, on_wall, points = wall
    left = [lamp_seen_from(points[on_wall], np.array(at), np.full(3, r), 400) for r, at in BALLS]
    expected = np.prod(left, axis=0)
    umbra, lit, error = expected == 0, expected == 1, share[on_wall] - expected
    assert umbra.sum() > 50 and lit.sum() > 5000 and (~umbra & ~lit).sum() > 300
    assert share[on_wall][umbra].max() < 0.02
    assert share[on_wall][lit].min() > 0.98
    assert np.abs(error).max() < 0.12
    assert np.abs(error[~umbra & ~lit]).mean() < 0.035


def test_light_grows_outwards_from_the_middle_of_a_shadow(wall):
    share, on_wall, points = wall
    radius, at = BALLS[1]
    out = points - np.array(at)
    out = np.where(on_wall, np.linalg.norm(out - (out @ LIGHT)[..., None] * LIGHT, axis=-1), np.inf)  # across the light
    y, x = np.unravel_index(out.argmin(), out.shape)
    reach = int(2.2 * radius / WALL_M * CAMERA.fx)
    for line in (share[y, x : x + reach], share[y : y + reach, x]):
        assert line[0] < 0.02 and line[-1] > 0.98
        assert np.diff(line).min() > -1e-5
        assert ((line > 0.1) & (line < 0.9)).sum() >= 3


@pytest.mark.parametrize("stretch", [(1.0, 4.0, 0.7), (4.0, 1.0, 0.7), (3.0, 3.0, 0.3), (0.3, 3.0, 3.0)])
def test_shadows_have_the_shape_of_what_throws_them(bank, stretch):
    at = (-0.4, 0.0, 2.4)
    share, on_wall, points = shadow_on_wall(bank, ball(0.12, at, stretch))
    expected = lamp_seen_from(points[on_wall], np.array(at), 0.12 * np.array(stretch), 400)
    error, partly = share[on_wall] - expected, (expected > 0) & (expected < 1)
    assert (expected < 0.1).sum() > 20 and partly.sum() > 100
    assert np.abs(error).max() < 0.4  # at the tips of thin ones
    assert np.abs(error[partly]).mean() < 0.05
    assert np.abs(error[~partly]).max() < 0.1


def test_only_direct_light_is_dimmed(bank):
    body = ball(*BALLS[1])
    for ambient in (0.3, 0.8):
        lit, shaded = (seen(bank, room(), body, lamp=lamp, ambient=ambient)[0] for lamp in (0.0, LAMP))
        direct = (1 - ambient) * (0.5 - 0.5 * LIGHT[2])  # half Lambert on the wall, which faces -z
        assert (shaded / lit).min() == pytest.approx(ambient / (ambient + direct), abs=1e-3)


def test_rooms_and_bodies_themselves_are_no_shade(bank):
    """A room's own furniture throws none, nor does a part on its own body."""
    table = Part(BOX, np.array((0.3, 0.3, 0.02)), np.array((0.0, 0.0, 2.0)), np.eye(3), grey())
    furnished = Body((*room().parts, table))
    pair = Body((*ball(*BALLS[0]).parts, *ball(0.2, (0.3, 0.12, 2.0)).parts), clutter=True)
    for bodies, part in (((furnished,), None), ((room(), pair), 2)):
        (lit, _, parts), (shaded, _, _) = (seen(bank, *bodies, lamp=lamp) for lamp in (0.0, LAMP))
        mine = np.ones_like(parts, bool) if part is None else parts == part
        inner = mine & (np.roll(mine, 1, 0) & np.roll(mine, -1, 0) & np.roll(mine, 1, 1) & np.roll(mine, -1, 1))
        assert inner.sum() > 20
        np.testing.assert_allclose(shaded[inner], lit[inner], atol=1e-6)


def test_a_highlight_is_where_a_mirror_would_show_the_lamp(bank):
    toward = np.array([0.25, -0.15, -1.0]) / np.linalg.norm([0.25, -0.15, -1.0])
    still = Motion(np.zeros(3), np.eye(3))
    dull, glossy = (
        Renderer(Scene((room(gloss=gloss),), still, toward, 0.5, bank), CAMERA).frames(NOW).image[0]
        for gloss in (0.0, 0.4)
    )
    added = glossy - dull
    rays = np.moveaxis(lens_rays(CAMERA)[0][0].astype(float), 0, -1)
    mirrored = np.concatenate((rays, -np.ones((*rays.shape[:2], 1))), axis=-1)  # the wall turns z around
    mirrored /= np.linalg.norm(mirrored, axis=-1, keepdims=True)
    y, x = np.unravel_index((mirrored @ toward).argmax(), added.shape)
    at = np.unravel_index(added.argmax(), added.shape)
    assert abs(at[0] - y) <= 1 and abs(at[1] - x) <= 1
    assert added.max() == pytest.approx(0.4, rel=0.02)
    assert added.min() >= -1e-6 and np.median(added) < 0.1


def test_shadows_do_not_depend_on_what_else_a_tile_sees(bank):
    """What may throw a shadow is listed per tile: other tiles must not change any pixel."""
    scene = Scene(
        (room(), *(ball(*each) for each in BALLS)), Motion(np.zeros(3), np.eye(3)), LIGHT, 0.2, bank, lamp=LAMP
    )
    shifted = replace(CAMERA, cx=CAMERA.cx - 3, cy=CAMERA.cy - 5, width=CAMERA.width - 3, height=CAMERA.height - 5)
    one, two = (Renderer(scene, camera).frames(NOW).image[0] for camera in (CAMERA, shifted))
    np.testing.assert_allclose(two[2:-2, 2:-2], one[5:, 3:][2:-2, 2:-2], atol=2e-6)


def test_no_caster_is_left_out_that_shades_some_point_of_a_box():
    """Stretched and turned casters, boxes of all sizes: whatever hides light from a point in one is listed."""
    rng, listed, shading = np.random.default_rng(5), 0, 0
    for _ in range(300):
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        to_unit = turn / rng.uniform(0.02, 0.5, (3, 1))
        row = shadow_rows(to_unit[None, None], -(to_unit @ rng.normal(size=3) * 0.7)[None, None], LIGHT[None], LAMP)
        row = row[0, 0].astype(np.float32)
        middle, half = rng.normal(size=3).astype(np.float32), rng.uniform(0.01, 0.4, 3).astype(np.float32)
        points = middle + half * rng.uniform(-1, 1, (200, 3)).astype(np.float32)
        hides = max(hidden_share(row, *point) for point in points) > 0
        may = may_shade(row, tuple(middle), tuple(half))
        assert may or not hides
        listed, shading = listed + may, shading + hides
    assert 10 < shading <= listed < 150, "both kinds occur, and few are listed in vain"
