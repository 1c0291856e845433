import numpy as np
import pytest

from evimo.classical.sharpness import (
    ARM,
    MARGIN,
    PEAK,
    blur,
    read,
    sharpest,
    sharpness,
    sharpness_slope,
    splat,
    warp_back,
)

SIZE = (40, 48)
CENTRE = (24.0, 20.0)


def room() -> np.ndarray:
    return np.zeros((3, SIZE[0] + 2 * MARGIN, SIZE[1] + 2 * MARGIN), np.float32)


def dots(motion, *, count: int = 600, seed: int = 0):
    """Events of 20 dots that move by `motion` about CENTRE, at random times up to one and a half slices away."""
    rng = np.random.default_rng(seed)
    x0, y0 = rng.uniform(14, 34, 20), rng.uniform(10, 30, 20)
    which, t = rng.integers(0, 20, count), rng.uniform(-1.5, 1.5, count)
    dx, dy = (x0[which] - CENTRE[0]) / ARM, (y0[which] - CENTRE[1]) / ARM
    u, v, s, r = motion
    x, y = x0[which] + t * (u + s * dx - r * dy), y0[which] + t * (v + s * dy + r * dx)
    return x.astype(np.float32), y.astype(np.float32), t.astype(np.float32)


def test_an_event_is_carried_back_along_translation_expansion_and_turn():
    x, y, t = (np.array([value], np.float32) for value in (CENTRE[0] + ARM, CENTRE[1], 0.5))
    at = np.empty((2, 1), np.float32)
    for component, shift in enumerate(((1, 0), (0, 1), (1, 0), (0, 1))):
        warp_back(x, y, t, 2 * np.eye(4)[component], CENTRE, at)
        np.testing.assert_allclose(at[:, 0], (x[0] - shift[0], y[0] - shift[1]), atol=1e-5)


def test_splat_shares_a_weight_among_four_pixels_and_read_is_its_adjoint():
    image = room()[0]
    at, weight = np.array([[2.25], [1.5]], np.float32), np.array([8], np.float32)
    splat(at, weight, image)
    np.testing.assert_allclose(image[MARGIN + 1 : MARGIN + 3, MARGIN + 2 : MARGIN + 4], [[3, 1], [3, 1]])
    assert image.sum() == 8
    rng = np.random.default_rng(0)
    at, weight = rng.uniform(-3, 50, (2, 100)).astype(np.float32), rng.random(100).astype(np.float32)
    other, into = rng.random(image.shape).astype(np.float32), np.empty(100, np.float32)
    splat(at, weight, image)
    read(at, other, into)
    assert float((image * other).sum()) == pytest.approx(float(weight @ into), rel=1e-5)


def test_the_peak_is_what_one_event_leaves_at_its_own_place():
    image, across, soft = room()
    splat(np.array([[9.0], [9.0]], np.float32), np.ones(1, np.float32), image)
    blur(image, across, soft)
    assert soft.max() == pytest.approx(PEAK)
    assert soft.sum() == pytest.approx(1)


def test_the_slope_is_the_derivative():
    x, y, t = dots((3, -2, 1, 0.5))
    weight = np.random.default_rng(1).random(len(x)).astype(np.float32)
    at, motion, slope = np.empty((2, len(x)), np.float32), np.array([2.6, -1.7, 0.6, 0.8]), np.zeros(4)
    sharpness_slope(x, y, t, weight, motion, CENTRE, at, room(), slope)
    for k in range(4):
        values = []
        for step in (-0.02, 0.02):
            moved = motion.copy()
            moved[k] += step
            warp_back(x, y, t, moved, CENTRE, at)
            values.append(sharpness(at, weight, room()))
        assert slope[k] == pytest.approx((values[1] - values[0]) / 0.04, rel=0.1, abs=1)  # bilinear weights have kinks


@pytest.mark.parametrize("true", [(4, 1, 0, 0), (-3, 2, 1, 0), (0, -5, 0, 1.5), (0, 0, 0, 0)])
def test_the_sharpest_motion_is_the_true_one(true):
    x, y, t = dots(true)
    start = np.array(true, float) + (1.2, -0.8, -0.6, 0.6)
    found = sharpest(x, y, t, np.ones(len(x), np.float32), start, CENTRE, np.full(4, 20.0), room())
    farthest = np.array([1, 1, 10 / ARM, 10 / ARM])  # px per slice at the outermost dots
    np.testing.assert_allclose(found * farthest, true * farthest, atol=0.15)


def test_a_narrow_spread_keeps_the_start():
    x, y, t = dots((4, 1, 0, 0))
    start = np.array([2.0, 1, 0, 0])
    found = sharpest(x, y, t, np.ones(len(x), np.float32), start, CENTRE, np.full(4, 1e-3), room())
    np.testing.assert_allclose(found, start, atol=0.05)


def test_events_outside_the_box_count_nothing():
    at = np.array([[-5.0, 100.0, 3.0], [3.0, 3.0, -0.01]], np.float32)
    assert sharpness(at, np.ones(3, np.float32), room()) == 0
    into = np.ones(3, np.float32)
    read(at, np.ones_like(room()[0]), into)
    assert not into.any()
