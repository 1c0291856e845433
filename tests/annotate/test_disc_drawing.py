"""Discs of all sizes and slants, drawn: every pixel whose ray meets one is there, and no other."""

from pathlib import Path

import numpy as np
import pytest

from evimo.annotate.lens import LANES, lens_tables
from evimo.annotate.surfaces import surfaces_of
from evimo.annotate.zbuffer import draw, drawn
from evimo.captures.scans import Scan
from evimo.geometry.camera import Camera

CAMERAS = {
    "radtan": Camera(96.0, 97.0, 65.5, 50.0, 100, 130, (-0.3, 0.08, 1e-3, -5e-4)),
    "pincushion": Camera(96.0, 97.0, 65.5, 50.0, 100, 130, (0.25, 0.1, 0.0, 0.0, 0.02)),
    "fisheye": Camera(75.0, 75.0, 64.5, 49.5, 100, 130, (0.02, -0.01, 0.002, 0.0), "fisheye"),
}


def surfaces_of_points(points):
    return surfaces_of([Scan(Path("made"), points, np.zeros((0, 3), np.int64), np.zeros((0, 3)))])


def rays_of(camera):
    return np.concatenate((camera.normalised(camera.pixels())[0], np.ones((*camera.size, 1))), axis=-1)


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_each_disc_is_asked_by_all_pixels_that_see_it(camera):
    """Every disc is met with every ray in double precision: no bounds, no lens but that of the rays."""
    rng = np.random.default_rng(9)
    surfaces = surfaces_of_points(rng.uniform((-2, -1.5, -1), (2, 1.5, 4), (300, 3)))
    fine, (start, stop) = np.full(1, 1e-9), surfaces.levels[0]
    first, last = surfaces.blocks[start, 0], surfaces.blocks[stop - 1, 1]
    surfaces.discs[6, first:last] = rng.choice((0.003, 0.02, 0.1, 0.4), last - first)
    surfaces.chunk_balls[:, 3] = surfaces.block_balls[:, 3] = 10.0
    depth, seen = np.full(camera.size, np.inf, np.float32), np.zeros(camera.size, np.uint8)
    draw(surfaces, lens_tables(camera), np.eye(4)[None, :3], np.array([5], np.uint8), fine, depth, seen)
    discs = surfaces.discs[:, first:last].astype(np.float64)
    met = np.zeros(camera.size, np.bool_)
    nearest = np.full(camera.size, np.inf)
    for x, y, z, *normal, radius in discs.T.tolist():
        at = (np.array((x, y, z)) @ normal) / (rays_of(camera) @ normal)
        hit = (
            (at > 0.01) & (np.linalg.norm(at[..., None] * rays_of(camera) - (x, y, z), axis=-1) <= radius) & (z > 0.01)
        )
        met |= hit
        nearest = np.where(hit, np.minimum(nearest, at), nearest)
    assert 0.2 < met.mean() < 0.999
    assert ((seen == 5) != met).mean() < 1e-3  # rims, in single precision
    both = (seen == 5) & met
    assert (depth[both] > nearest[both] * (1 - 1e-4)).all()
    assert (depth[both] <= nearest[both] + 0.8 + 1e-3).all()  # a neighbour within a radius stays


def test_the_last_pixels_see_a_disc_and_nothing_wraps_around():
    camera = CAMERAS["radtan"]
    ray = rays_of(camera)[-1, -1]
    assert len(lens_tables(camera).ray_x) == camera.size[0] * camera.size[1] + LANES
    points = 2 * ray + np.random.default_rng(1).uniform(-0.1, 0.1, (500, 3)) * (1, 1, 0)
    _, seen = drawn(surfaces_of_points(points), lens_tables(camera), np.eye(4)[None, :3], [1], np.full(1, 0.7))
    assert seen[-1, -1] == 1
    assert not seen[:, :100].any()
