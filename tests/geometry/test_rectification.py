"""Rectification: against OpenCV's undistortion, its promises about size and focal length, and both ways of mapping."""

import warnings
from functools import cache

import cv2
import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from evimo.errors import BadInput, EvimoWarning
from evimo.geometry.calibration import load_camera
from evimo.geometry.camera import Camera
from evimo.geometry.rectification import halved_mask, rectified

PINHOLE = Camera(200.0, 190.0, 170.0, 120.0, 260, 346)
BARREL = Camera(257.7, 256.6, 188.3, 131.6, 260, 346, (-0.363, 0.125, -1e-4, -5e-6))
FOLDED = Camera(259.9, 257.9, 155.0, 115.0, 260, 346, (-0.512, 0.472, -0.0016, -0.0029, -0.312))
PINCUSHION = Camera(257.7, 257.7, 170.0, 131.6, 260, 346, (0.2, 0.05, 0.0, 0.0))
LARGE = Camera(1000.0, 1000.0, 640.0, 350.0, 720, 1280, (-0.3, 0.1, 0.001, 0.0))
FISHEYE = Camera(180.0, 180.0, 172.0, 131.0, 260, 346, (0.01, -0.004, 0.001, 0.0), "fisheye")
WITH_LENS = [BARREL, FOLDED, PINCUSHION, LARGE, FISHEYE]


known = cache(rectified)  # the same for every test


def matrix(camera):
    return np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])


def sensor_positions_by_opencv(rectification):
    """For each rectified pixel, its column and row on the sensor."""
    camera, image = rectification.camera, rectification.image
    make = cv2.fisheye.initUndistortRectifyMap if camera.lens == "fisheye" else cv2.initUndistortRectifyMap
    size = (image.width, image.height)
    return make(matrix(camera), np.array(camera.distortion), np.eye(3), matrix(image), size, cv2.CV_32FC1)


def test_without_lens_and_small_enough_it_is_the_sensor_itself():
    same = rectified(PINHOLE)
    x, y = np.meshgrid(np.arange(346), np.arange(260))
    assert same.image == PINHOLE
    assert (same.x == x).all() and (same.y == y).all() and same.x.dtype == np.float32
    assert same.valid.all() and same.image_valid.all() and same.invalid == 0
    ids = np.random.default_rng(0).integers(0, 9, (260, 346), np.uint8)
    assert (same.from_sensor(ids) == ids).all()


def test_a_lens_of_zeros_is_no_lens():
    zeros = Camera(250.0, 250.0, 120.0, 90.0, 180, 240, (0.0, 0.0, 0.0, 0.0))
    assert rectified(zeros).image.fx == 250
    assert (rectified(zeros).x[:, 17] == 17).all()


@pytest.mark.parametrize("size", [(720, 1280), (480, 640), (640, 480), (180, 240), (1, 5000)])
def test_size_keeps_the_shape_and_the_limit(size):
    image = rectified(Camera(500.0, 500.0, size[1] / 2, size[0] / 2, *size)).image
    scale = min(1, 260 / size[0], 346 / size[1])
    assert image.height <= 260 and image.width <= 346
    assert abs(image.height - scale * size[0]) <= 1 and abs(image.width - scale * size[1]) <= 1
    assert image.fx == pytest.approx(500 * scale)


def test_convention_shrinking_moves_centres_by_the_half_pixel_rule():
    half = rectified(Camera(500.0, 500.0, 340.0, 250.0, 520, 692))
    assert half.image == Camera(250.0, 250.0, 169.75, 124.75, 260, 346)
    assert (half.x[0, :4].tolist(), half.y[:4, 0].tolist()) == ([-0.25, 0.25, 0.75, 1.25],) * 2  # 2x2 pixels each
    assert half.valid.all()


@pytest.mark.parametrize("camera", WITH_LENS)
def test_positions_agree_with_opencv(camera):
    rectification = known(camera)
    columns, rows = sensor_positions_by_opencv(rectification)
    inside = rectification.valid & (rectification.x >= 0) & (rectification.x <= rectification.image.width - 1)
    inside &= (rectification.y >= 0) & (rectification.y <= rectification.image.height - 1)
    at = rectification.y[inside], rectification.x[inside]
    back = np.stack([map_coordinates(each, at, order=1) for each in (columns, rows)], axis=-1)
    off = np.linalg.norm(back - camera.pixels()[inside], axis=-1)
    assert (
        np.quantile(off, 0.99) < 0.05 * camera.width / rectification.image.width
    )  # of a pixel: the lens is not quite linear
    x, y = rectification.source % camera.width, rectification.source // camera.width
    good = rectification.image_valid
    assert np.abs(x - columns)[good].max() < 0.51 and np.abs(y - rows)[good].max() < 0.51


@pytest.mark.parametrize("camera", WITH_LENS)
def test_focal_length_is_the_largest_that_holds_95_percent(camera):
    rectification = known(camera)
    image = rectification.image
    usable = rectification.valid.size - rectification.folded
    scale = min(1, 260 / camera.height, 346 / camera.width)
    assert image.fx == image.fy and image.is_pinhole
    assert rectification.valid.sum() >= 0.95 * usable
    assert image.fx <= scale * min(camera.fx, camera.fy)
    if image.fx < scale * min(camera.fx, camera.fy):
        xy, has_direction = camera.normalised(camera.pixels())
        x, y = (xy[has_direction] * image.fx * 1.001 + (image.cx, image.cy)).T
        held = (np.abs(x - (image.width - 1) / 2) <= image.width / 2) & (
            np.abs(y - (image.height - 1) / 2) <= image.height / 2
        )
        assert held.sum() < 0.95 * usable


def test_pincushion_is_not_enlarged():
    assert rectified(PINCUSHION).image.fx == 257.7


@pytest.mark.parametrize("camera", WITH_LENS)
def test_every_sensor_pixel_is_kept_or_counted(camera):
    rectification = known(camera)
    x, y, valid = rectification.x, rectification.y, rectification.valid
    assert rectification.invalid == (~valid).sum() == rectification.folded + rectification.outside
    assert np.isfinite(x).all() and np.isfinite(y).all()
    assert x[valid].min() >= -0.5 and x[valid].max() < rectification.image.width - 0.5
    assert y[valid].min() >= -0.5 and y[valid].max() < rectification.image.height - 0.5


def test_nothing_comes_back_where_the_sensor_has_no_pixel():
    rectification = rectified(FOLDED)
    there = rectification.from_sensor(np.ones(FOLDED.size, np.uint8))
    assert there.dtype == np.uint8
    assert (there.astype(bool) == rectification.image_valid).all()
    assert 0 < (~rectification.image_valid).mean() < 0.2


def test_a_rectified_pixel_off_the_sensor_is_not_valid():
    """Barrel distortion: the rectified image's left border sees beyond the middle of the sensor's left border."""
    rectification = rectified(BARREL)
    columns, rows = sensor_positions_by_opencv(rectification)
    on_sensor = (columns > -0.49) & (columns < 345.49) & (rows > -0.49) & (rows < 259.49)
    off_sensor = (columns < -0.51) | (columns > 345.51) | (rows < -0.51) | (rows > 259.51)
    assert rectification.image_valid[on_sensor].all()
    assert not rectification.image_valid[off_sensor].any()
    assert off_sensor.any()


def test_the_warning_counts_and_silence_means_all_is_well():
    with pytest.warns(EvimoWarning, match=r"4498 of 89960 sensor pixels are left out: 4498 \(5.0%\) outside"):
        rectified(BARREL).warn_of_invalid()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rectified(PINHOLE).warn_of_invalid()


def test_a_seventh_of_a_real_sensor_is_left_out_and_said(shared_data):
    name = "calibration_camera_DAVIS346_00000133-2021_03_02_17_44_07.xml"
    rectification = rectified(load_camera(shared_data(f"recordings/davis346_ball_person/{name}")))
    assert rectification.folded / 89_960 == pytest.approx(0.14, abs=0.005)
    with pytest.warns(EvimoWarning, match="not monotonic"):
        rectification.warn_of_invalid()


def test_a_halved_mask_is_the_share_of_four_pixels():
    mask = np.ones((3, 5), np.bool_)
    mask[0, 0] = False
    halved = halved_mask(mask, (4, 8))
    assert halved.tolist() == [[0.75, 1, 0.5, 0], [0.5, 0.5, 0.25, 0]]


def test_calibrations_that_cannot_be_used_are_refused():
    with pytest.raises(BadInput, match="off the image"):
        rectified(Camera(200.0, 200.0, 900.0, 100.0, 260, 346, (0.01, 0.0, 0.0, 0.0)))
    with pytest.raises(BadInput, match="no direction"):
        rectified(Camera(2.0, 2.0, 0.5, 0.5, 2, 2, (-100.0, 0.0, 0.0, 0.0)))
