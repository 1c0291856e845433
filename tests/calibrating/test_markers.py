"""Balls are found in scans: planted ones through noise and clutter, and those that people cut out of EV-IMO's scans."""

import numpy as np
import pytest

from evimo.calibrating.markers import RADII, locate_markers
from evimo.calibrating.spheres import find_sphere
from evimo.captures.scans import load_scan


def ball(rng, centre, radius, *, count=160, noise=2e-5):
    """Points on the upper two thirds of a ball: the rest is glued to something."""
    ways = rng.normal(size=(3 * count, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    ways = ways[ways[:, 2] > -0.35][:count]
    return np.asarray(centre) + ways * (radius + rng.normal(0, noise, (len(ways), 1)))


def plate(rng, size, spacing=7e-4):
    """A gently waved plate below z = 0 with a rounded edge: what scans mostly hold."""
    at = np.arange(-size / 2, size / 2, spacing)
    x, y = (each.ravel() for each in np.meshgrid(at, at))
    z = -0.004 + 0.002 * np.sin(60 * x) - 40 * np.maximum(np.hypot(x, y) - 0.4 * size, 0) ** 2
    return np.stack((x, y, z), axis=1) + rng.normal(0, 3e-5, (len(x), 3))


def test_planted_balls_are_found_and_nothing_else():
    rng = np.random.default_rng(1)
    planted = np.array(((0.02, 0.01, 0), (-0.03, 0.02, 0.001), (0.0, -0.03, 0.002), (0.03, 0.03, 0.01)))
    radii = (0.0032, 0.0032, 0.0047, 0.0078)
    counts = (150, 150, 320, 900)
    balls = [ball(rng, *each, count=count) for *each, count in zip(planted, radii, counts, strict=True)]
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    scan = np.concatenate([plate(rng, 0.12), *balls]) @ turn.T + (0.3, -0.2, 1.0)
    found = locate_markers(rng.permutation(scan))
    away = np.linalg.norm((planted @ turn.T + (0.3, -0.2, 1.0))[:, None] - [each.centre for each in found], axis=2)
    assert len(found) == 4
    assert away.min(axis=1).max() < 1e-4
    assert sorted(each.radius for each in found) == pytest.approx(sorted(radii), abs=1e-4)


def test_a_scan_without_balls_has_none():
    assert locate_markers(plate(np.random.default_rng(2), 0.06)) == ()
    assert locate_markers(np.zeros((5, 3))) == ()


def test_half_of_the_points_may_be_anything():
    rng = np.random.default_rng(3)
    points = np.concatenate((ball(rng, (1, 2, 3), 0.005), rng.uniform(-0.008, 0.008, (160, 3)) + (1, 2, 3)))
    sphere = find_sphere(points, radii=RADII, tolerance=1.5e-4, rng=rng)
    assert sphere is not None
    assert np.linalg.norm(sphere.centre - (1, 2, 3)) < 5e-5
    assert sphere.inliers[:160].mean() > 0.95
    assert sphere.inliers[160:].mean() < 0.2


@pytest.mark.parametrize("name", ["cup", "toy_car", "toy_plane"])
def test_markers_of_evimos_scans_lie_where_people_found_them(shared_data, name):
    """`config.txt` was made by cutting out each ball by hand; here they are found in the whole scan."""
    scan = load_scan(shared_data(f"scans/{name}"))
    found = np.array([each.centre for each in locate_markers(scan.points)])
    away = np.linalg.norm(scan.markers[:, None] - found, axis=2)
    assert len(found) == len(scan.markers)
    assert away.min(axis=1).max() < 2e-4
    assert len(set(away.argmin(axis=1))) == len(found)
