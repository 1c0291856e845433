import numpy as np
import pytest
from scipy import ndimage

from evimo.events.local_motion import CANDIDATE_CHANNELS, motion_candidates
from evimo.events.stack import EventStack, voxel_grid

SIZE = (36, 48)
XX, XY, YY, XT, YT, TT = range(6)


def random_events(count=12_000, *, seed=0):
    """Events of dots that move, each in its own way."""
    rng = np.random.default_rng(seed)
    t, dot = rng.uniform(-2.5, 2.5, count), rng.integers(0, 60, count)
    x, y = (rng.uniform(0, side, 60)[dot] + rng.normal(0, 1.5, 60)[dot] * t for side in SIZE[::-1])
    return EventStack(*(each.astype(np.float32) for each in (x, y, t)), rng.random(count) < 0.5)


def candidates_by_another_road(voxels):
    """The formulas in float64, by scipy."""
    counts = np.expm1(voxels.astype(float)).reshape(5, 3, 2, *SIZE).sum(1) / 4
    coarse = np.log1p(halved(counts))
    first, before, here, after, last = sharp = blurred(np.log1p(counts), 0.7)
    near = halved(products(before, here, after))
    longer = near + halved(products(first, before, here) + products(here, after, last) + products(first, here, last, 4))
    large = motion(blurred(near, 4))
    far = 2 * motion(blurred(products(*blurred(coarse, 0.7)[1:4]), 4))
    refined = [after_warping(sharp[1:4], np.clip(guess, -6, 6)) for guess in (large, far)]
    small = blurred(near, 0.7)
    moved = [each + np.clip(motion(left), -6, 6) for each, left in refined]
    told = [trust(small), *(trust(left) for _, left in refined)]
    return np.concatenate((motion(small), large, motion(blurred(longer, 2.5)), *moved, *told, directions(small)))


def blurred(images, sigma_px):
    return ndimage.gaussian_filter(images, sigma_px, axes=(-2, -1), mode="constant", truncate=2.5)


def halved(images):
    return images.reshape(*images.shape[:-2], images.shape[-2] // 2, 2, images.shape[-1] // 2, 2).mean((-3, -1))


def products(before, here, after, slices=2):
    mean = (before + 2 * here + after) / 4
    dy, dx = (ndimage.correlate1d(mean, (-0.5, 0, 0.5), axis=axis, mode="constant") for axis in (-2, -1))
    dt = (after - before) / slices
    return np.stack((dx * dx, dx * dy, dy * dy, dx * dt, dy * dt, dt * dt)).sum(1)


def motion(p):
    ridge = 0.05 * (p[XX] + p[YY]).mean() + 1e-6 + 0.02 * (p[XX] + p[YY])
    normal = np.stack((p[XX] + ridge, p[XY], p[XY], p[YY] + ridge), -1).reshape(*p.shape[1:], 2, 2)
    solved = np.linalg.solve(normal, -np.stack((p[XT], p[YT]), -1)[..., None])
    return np.moveaxis(solved[..., 0], -1, 0)


def after_warping(images, guess):
    """The guess, and windowed products of what it leaves."""
    before, here, after = images
    at = np.meshgrid(*(np.clip((np.arange(side) + 0.5) / 2 - 0.5, 0, side // 2 - 1) for side in SIZE), indexing="ij")
    u, v = (ndimage.map_coordinates(each, at, order=1) for each in blurred(guess, 0.7))
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    before, after = (
        np.stack(
            [ndimage.map_coordinates(each, (y + s * v, x + s * u), order=1, mode="grid-constant") for each in pair]
        )
        for s, pair in ((-1, before), (1, after))
    )
    return guess, blurred(halved(products(before, here, after)), 2)


def trust(p):
    contrast = p[XX] + p[YY]
    mean = contrast.mean() + 1e-6
    spread = 4 * (p[XX] * p[YY] - p[XY] ** 2) / (contrast + 0.01 * mean) ** 2
    return np.stack((contrast / (contrast + mean), spread, p[TT] / (p[TT] + contrast + 0.1 * mean)))


def directions(p):
    contrast = p[XX] + p[YY]
    return p[:3] / (contrast + 0.3 * contrast.mean() + 1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_candidates_follow_the_formulas(seed):
    voxels = voxel_grid(random_events(seed=seed), SIZE)
    found = motion_candidates(voxels)
    assert found.shape == (CANDIDATE_CHANNELS, SIZE[0] // 2, SIZE[1] // 2)
    np.testing.assert_allclose(found, candidates_by_another_road(voxels), rtol=1e-4, atol=2e-5)


def drifting(u, v, *, count=40_000):
    """Events of a texture that moves as a whole, px per slice."""
    rng = np.random.default_rng(3)
    dot, t = rng.integers(0, 400, count), rng.uniform(-2.5, 2.5, count)
    x, y = rng.uniform(-20, 116, 400)[dot] + u * t, rng.uniform(-20, 92, 400)[dot] + v * t
    return EventStack(*(each.astype(np.float32) for each in (x, y, t)), np.ones(count, np.bool_))


@pytest.mark.parametrize(("u", "v"), [(0.4, -0.2), (-1.0, 0.5), (2.0, 1.5)])
def test_a_texture_that_moves_as_a_whole_has_one_motion(u, v):
    found = motion_candidates(voxel_grid(drifting(u, v), (72, 96)))
    middle = found[:, 8:-8, 8:-8]
    np.testing.assert_allclose(np.median(middle[6:8], axis=(1, 2)), (u, v), rtol=0.15, atol=0.05)
    for trusted in middle[10:19]:
        assert trusted.min() >= 0 and trusted.max() <= 1


def test_where_nothing_happens_nothing_moves():
    found = motion_candidates(np.zeros((30, 16, 24), np.float32))
    np.testing.assert_array_equal(found, np.zeros((CANDIDATE_CHANNELS, 8, 12)))
