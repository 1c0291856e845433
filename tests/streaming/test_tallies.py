import numpy as np
from scipy import ndimage

from evimo.streaming.tallies import extents, shared_pixels, weighted_sums


def random_labels(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).choice([0, 0, 0, 1, 7, 255], (13, 17)).astype(np.uint8)


def test_extents_are_those_of_scipy():
    labels = random_labels(0)
    found = extents(labels)
    for number, box in enumerate(ndimage.find_objects(labels.astype(int)), start=1):
        assert found.area_px[number] == (labels == number).sum()
        if box is not None:
            rows, columns = box
            assert (found.x0[number], found.y0[number]) == (columns.start, rows.start)
            assert (found.x1[number], found.y1[number]) == (columns.stop - 1, rows.stop - 1)
            y, x = ndimage.center_of_mass(labels == number)
            area_px = found.area_px[number]
            np.testing.assert_allclose([found.sum_x[number] / area_px, found.sum_y[number] / area_px], [x, y])
    assert found.area_px[0] == 0


def test_weighted_sums_are_those_of_scipy():
    labels, rng = random_labels(1), np.random.default_rng(2)
    weights, values = rng.random((13, 17), np.float32), rng.normal(size=(3, 13, 17)).astype(np.float32)
    weight, first, second = weighted_sums(labels, weights, values)
    known = [1, 7, 255]
    np.testing.assert_allclose(weight[known], ndimage.sum(weights, labels, known), rtol=1e-5)
    for axis in range(3):
        np.testing.assert_allclose(first[known, axis], ndimage.sum(weights * values[axis], labels, known), atol=1e-5)
    np.testing.assert_allclose(second[known], ndimage.sum(weights * (values**2).sum(0), labels, known), rtol=1e-5)


def test_shared_pixels_are_a_joint_histogram():
    labels, others = random_labels(3), random_labels(4)
    expected, *_ = np.histogram2d(labels.ravel(), others.ravel(), bins=np.arange(257) - 0.5)
    np.testing.assert_array_equal(shared_pixels(labels, others), expected)
