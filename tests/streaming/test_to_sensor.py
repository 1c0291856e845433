"""Maps come back to where their pixels are seen, whatever the lens."""

from functools import cache

import numpy as np
import pytest

from evimo.geometry.camera import Camera
from evimo.geometry.rectification import rectified
from evimo.streaming.to_sensor import ToSensor

PINHOLE = Camera(200.0, 190.0, 170.0, 120.0, 260, 346)
BARREL = Camera(257.7, 256.6, 188.3, 131.6, 260, 346, (-0.363, 0.125, -1e-4, -5e-6))
LARGE = Camera(1000.0, 1000.0, 640.0, 350.0, 720, 1280, (-0.3, 0.1, 0.001, 0.0))
FISHEYE = Camera(180.0, 180.0, 172.0, 131.0, 260, 346, (0.01, -0.004, 0.001, 0.0), "fisheye")

known = cache(rectified)  # the same for every test


def test_without_a_lens_maps_are_what_they_were():
    maps = np.random.default_rng(0).random((3, 2, 260, 346), np.float32)
    np.testing.assert_array_equal(ToSensor(known(PINHOLE)).bilinear(maps), maps)


@pytest.mark.parametrize("camera", [BARREL, LARGE, FISHEYE])
def test_smooth_maps_survive_the_way_to_the_sensor_and_back(camera):
    rectification = known(camera)
    x, y = np.meshgrid(*(np.arange(n, dtype=np.float32) for n in rectification.image.size[::-1]))
    there = ToSensor(rectification).bilinear(np.stack((x, y))[None])
    assert there.shape == (1, 2, *camera.size) and there.dtype == np.float32
    inner = rectification.valid & (rectification.x > 0) & (rectification.y > 0)
    inner &= (rectification.x < x.max()) & (rectification.y < y.max())
    np.testing.assert_allclose(there[0, 0][inner], rectification.x[inner], atol=1e-3)
    back = rectification.from_sensor(there[0])
    assert back.shape == (2, *rectification.image.size)
    assert np.abs(back - np.stack((x, y)))[:, rectification.image_valid].max() < 1.5


@pytest.mark.parametrize("camera", [LARGE, BARREL, FISHEYE])
def test_coarser_maps_lie_where_their_pixels_lie(camera):
    rectification = known(camera)
    height, width = rectification.image.size
    y, x = np.mgrid[: height // 2 + 3, : width // 2 + 5] * 2.0 + 0.5  # centres of 2 x 2 pixels, with a margin behind
    there = ToSensor(rectification, step=2).bilinear(np.stack((x, y)))
    inner = rectification.valid & (rectification.x > 1) & (rectification.y > 1)
    inner &= (rectification.x < width - 1) & (rectification.y < height - 1)
    np.testing.assert_allclose(there[0][inner], rectification.x[inner], atol=1e-3)
    np.testing.assert_allclose(there[1][inner], rectification.y[inner], atol=1e-3)


def test_borders_reach_outwards():
    rectification = rectified(Camera(20.0, 20.0, 2.0, 1.0, 4, 6))
    columns = np.tile(np.arange(3, dtype=np.float32), (2, 1))
    np.testing.assert_allclose(ToSensor(rectification, step=2).bilinear(columns)[1], [0, 0.25, 0.75, 1.25, 1.75, 2])


@pytest.mark.parametrize("size", [(1, 4), (4, 1), (1, 1)])
def test_an_image_of_one_row_or_column(size):
    rectification = rectified(Camera(9.0, 9.0, (size[1] - 1) / 2, (size[0] - 1) / 2, *size))
    maps = np.arange(size[0] * size[1], dtype=np.float32).reshape(size)
    np.testing.assert_array_equal(ToSensor(rectification).bilinear(maps), maps)


def test_labels_are_those_of_the_pixel_underneath():
    same = rectified(Camera(20.0, 20.0, 5.0, 3.0, 7, 11))  # odd sides: the last row and column stand alone
    labels = np.arange(4 * 6, dtype=np.uint8).reshape(4, 6)
    expected = labels.repeat(2, axis=0).repeat(2, axis=1)[:7, :11]
    np.testing.assert_array_equal(ToSensor(same, step=2).nearest(labels), expected)
