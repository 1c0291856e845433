import numpy as np
import pytest
from scipy import ndimage

from evimo.events.images import blurred, gaussian, warped

SIZE = (14, 22)


@pytest.fixture
def planes():
    return np.random.default_rng(0).random((2, *SIZE)).astype(np.float32)


@pytest.mark.parametrize("sigma_px", [0.7, 2, 2.5, 4])
def test_blurring_is_a_gaussian_filter_with_nothing_outside(planes, sigma_px):
    expected = ndimage.gaussian_filter(planes.astype(float), sigma_px, axes=(1, 2), mode="constant", truncate=2.5)
    np.testing.assert_allclose(blurred(planes, gaussian(sigma_px)), expected, atol=1e-6)


@pytest.mark.parametrize("sigma_px", [0.7, 2, 4])
def test_a_kernel_sums_to_one(sigma_px):
    middle, *side = gaussian(sigma_px)
    assert middle + 2 * sum(side) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("largest_px", [0.5, 6, 40])
def test_warping_reads_where_the_enlarged_guess_points(planes, largest_px):
    """The past against the motion, the future along it; what lies outside is zero."""
    guess = np.random.default_rng(1).uniform(-largest_px, largest_px, (2, SIZE[0] // 2, SIZE[1] // 2))
    rows, columns = (np.clip((np.arange(side) + 0.5) / 2 - 0.5, 0, side // 2 - 1) for side in SIZE)
    at = np.meshgrid(rows, columns, indexing="ij")
    u, v = (ndimage.map_coordinates(each, at, order=1) for each in guess)
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    moved = warped(planes, planes[::-1].copy(), guess.astype(np.float32))
    for way, sources, results in ((-1, planes, moved[0]), (1, planes[::-1], moved[1])):
        for source, result in zip(sources, results, strict=True):
            expected = ndimage.map_coordinates(source, (y + way * v, x + way * u), order=1, mode="grid-constant")
            np.testing.assert_allclose(result, expected, atol=2e-5)


def test_no_motion_warps_nothing(planes):
    still = np.zeros((2, SIZE[0] // 2, SIZE[1] // 2), np.float32)
    for moved in warped(planes, planes, still):
        np.testing.assert_array_equal(moved, planes)
