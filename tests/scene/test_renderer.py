"""The renderer against a slow ray caster that knows only which points are inside a body."""

import numpy as np
import pytest

from evimo.scene.bodies import BOX, CYLINDER, ELLIPSOID
from evimo.scene.rays.film import TILE
from evimo.scene.rays.tiles import MOST
from evimo.scene.renderer import WITHIN_PIXEL, Renderer, lens_rays

TIME = np.array([0.4])
FINE = 1500


def world_rays(scene, camera):
    """Origin (3,) and directions (N, 3) of all pixels, camera z = 1."""
    straight, _ = camera.normalised(camera.pixels().reshape(-1, 2))
    pose = scene.camera.at(TIME)
    return pose.position[0], np.column_stack((straight, np.ones(len(straight)))) @ pose.rotation[0].T


def marched(part, body_pose, origin, directions):
    """Depth (N,) where each ray first crosses the part's surface, by small steps and bisection; inf where never."""
    turn, at = body_pose

    def inside(t):
        points = origin + t[..., None] * directions[:, None]
        x, y, z = np.moveaxis((((points - at) @ turn) - part.position) @ part.rotation / part.half, -1, 0)
        if part.shape == BOX:
            return (np.maximum(np.maximum(abs(x), abs(y)), abs(z)) < 1) != part.inside
        if part.shape == ELLIPSOID:
            return x * x + y * y + z * z < 1
        if part.shape == CYLINDER:
            return (x * x + y * y < 1) & (abs(z) < 1)
        u, v = (x + 1) * part.openings[0], (y + 1) * part.openings[1]  # a net is a thin slab with holes
        bars = (u % 1 < part.openings[2]) | (v % 1 < part.openings[3])
        return bars & (abs(x) < 1) & (abs(y) < 1) & (abs(z) < 0.2)

    steps = np.broadcast_to(np.linspace(0, 6, FINE), (len(directions), FINE))
    hit = inside(steps)
    first = hit.argmax(axis=1)
    low, high = (np.take_along_axis(steps, np.maximum(k, 0)[:, None], 1) for k in (first - 1, first))
    for _ in range(30):
        middle = (low + high) / 2
        within = inside(middle)
        low, high = np.where(within, low, middle), np.where(within, middle, high)
    return np.where(hit.any(axis=1), high[:, 0], np.inf)


def expected(scene, camera):
    """Depth (H, W) and part index (H, W)."""
    origin, directions = world_rays(scene, camera)
    depths = []
    for body in scene.bodies:
        pose = body.motion.at(TIME) if body.motion else None
        placed = (pose.rotation[0], pose.position[0]) if pose else (np.eye(3), np.zeros(3))
        depths += [marched(part, placed, origin, directions) for part in body.parts]
    return np.min(depths, axis=0).reshape(camera.size), np.argmin(depths, axis=0).reshape(camera.size)


@pytest.fixture(scope="module")
def marched_scene(small_scene, camera):
    return expected(small_scene, camera)


def test_depth_and_parts_are_those_of_a_slow_ray_caster(small_scene, camera, marched_scene):
    depth, part = Renderer(small_scene, camera).frames(TIME).seen(0)
    true_depth, true_part = marched_scene
    same = part == true_part
    assert set(np.unique(true_part)) == set(range(6)), "every part should be in view"
    assert same.mean() > 0.99  # rays that graze an edge may fall on either side
    np.testing.assert_allclose(depth[same], true_depth[same], rtol=4e-3)  # the slow one's net is 4 mm thick
    assert np.median(abs(depth - true_depth)[same]) < 1e-5


def test_truth_names_movers_and_clutter(small_scene, camera, marched_scene):
    truth = Renderer(small_scene, camera).truth(400_000)
    _, part = marched_scene
    for name, of_part in ((truth.ids, [0, 0, 1, 1, 2, 0]), (truth.clutter, [0, 0, 0, 0, 0, 1])):
        assert (name == np.array(of_part)[part]).mean() > 0.99
    assert truth.valid.all()
    assert set(truth.objects) == {1, 2}


def test_rays_go_through_the_lens(camera):
    rays, valid = lens_rays(camera)
    assert valid.all()
    at = camera.project(np.moveaxis(rays, 1, -1).astype(float))
    np.testing.assert_allclose(at[0], camera.pixels(), atol=1e-3)
    within = at[1:] - camera.pixels()
    assert np.abs(within).max() < 0.5
    np.testing.assert_allclose(within.mean(axis=0), 0, atol=1e-3)


def test_a_glance_agrees_with_the_frame(small_scene, camera):
    renderer = Renderer(small_scene, camera)
    depth, part = renderer.frames(TIME).seen(0)
    seen_depth, seen_part = renderer.glance(TIME)
    np.testing.assert_array_equal(seen_part[0].reshape(renderer.coarse_size), part[2::4, 2::4])
    np.testing.assert_allclose(seen_depth[0].reshape(renderer.coarse_size), depth[2::4, 2::4], rtol=1e-4)


@pytest.mark.parametrize("stride", [1, 2, 4])
def test_tiles_cast_less_often_are_interpolated(small_scene, camera, stride):
    renderer = Renderer(small_scene, camera)
    times = 0.4 + np.linspace(0, 2e-3, 5)
    exact = renderer.frames(times)
    strides = np.full(renderer.cones.shape[:2], stride, np.int32)
    film = renderer.film(times, strides, renderer.frames(times[:1]))
    np.testing.assert_array_equal(film.image[[0, 4]], exact.image[[0, 4]])
    np.testing.assert_array_equal(film.depth[4], exact.depth[4])
    cast, between = exact.image[::stride], film.image[stride // 2 :: stride]
    if stride > 1:
        np.testing.assert_allclose(between[: len(cast) - 1], (cast[1:] + cast[:-1]) / 2, atol=1e-6)


def test_edges_are_smooth(small_scene, camera):
    """An edge pixel lies between what is on both sides of it; averaged over many, a moving edge darkens gradually."""
    renderer = Renderer(small_scene, camera)
    image = renderer.frames(0.4 + np.linspace(0, 0.02, 40)).image
    jumps = np.abs(np.diff(image, axis=0))
    one_ray = Renderer(small_scene, camera)
    one_ray.lens = (np.repeat(one_ray.lens[0][:1], 2, axis=0), one_ray.lens[1])
    hard = np.abs(np.diff(one_ray.frames(0.4 + np.linspace(0, 0.02, 40)).image, axis=0))
    assert np.percentile(jumps, 99.9) < 0.7 * np.percentile(hard, 99.9)


def test_irradiance_stays_within_what_surfaces_and_light_allow(small_scene, camera):
    image = Renderer(small_scene, camera).frames(TIME).image
    assert image.min() > 0.1 * 0.5 - 1e-6
    assert image.max() < 0.9 + 1e-6
    assert image.std() > 0.05


def test_all_rays_of_a_tile_have_room():
    """At edges in every pixel; compiled code would write beyond its arrays without a word."""
    assert TILE * TILE * len(WITHIN_PIXEL) <= MOST
