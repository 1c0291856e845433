"""Camera: against OpenCV, round trips, and where a lens model stops meaning anything."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evimo.errors import BadInput, EvimoWarning
from evimo.geometry.calibration import load_camera
from evimo.geometry.camera import Camera, assumed_camera

PINHOLE = Camera(200.0, 190.0, 170.0, 120.0, 260, 346)
LENSES = [
    ("radtan", (-0.36, 0.125, -1e-4, -5e-6)),
    ("radtan", (0.1, -0.05, 0.003, -0.002)),
    ("radtan", (-0.5, 0.47, -0.0016, -0.0029, -0.31)),
    ("fisheye", (0.78, -1.317, 1.49, -0.676)),
    ("fisheye", (-0.02, 0.01, -0.004, 0.001)),
    ("fisheye", ()),
]


def camera_with(lens, distortion, *, focal_px=260.0):
    return Camera(focal_px, focal_px - 2, 170.0, 120.0, 260, 346, distortion, lens)


def seen_by_opencv(camera, xy):
    points = np.concatenate((xy, np.ones_like(xy[:, :1])), axis=1)
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])
    coefficients = np.array(camera.distortion or (0.0,) * 4)
    if camera.lens == "fisheye":
        return cv2.fisheye.projectPoints(points[None], np.zeros(3), np.zeros(3), matrix, coefficients)[0].reshape(-1, 2)
    return cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, coefficients)[0].reshape(-1, 2)


@pytest.mark.parametrize(("lens", "distortion"), LENSES)
def test_projection_is_opencv_s(lens, distortion):
    camera = camera_with(lens, distortion)
    xy = np.random.default_rng(0).uniform(-0.7, 0.7, (500, 2))
    np.testing.assert_allclose(camera.project(xy), seen_by_opencv(camera, xy), atol=1e-9)


@pytest.mark.parametrize(("lens", "distortion"), LENSES)
def test_opencv_sees_normalised_points_where_the_pixels_are(lens, distortion):
    camera = camera_with(lens, distortion)
    xy, valid = camera.normalised(camera.pixels())
    assert valid.mean() > 0.8
    np.testing.assert_allclose(seen_by_opencv(camera, xy[valid]), camera.pixels()[valid], atol=1e-6)


@given(
    k1=st.floats(-0.5, 0.5),
    k2=st.floats(-0.3, 0.3),
    p=st.tuples(st.floats(-0.01, 0.01), st.floats(-0.01, 0.01)),
    k3=st.floats(-0.3, 0.3),
)
@settings(max_examples=40, deadline=None)
def test_inverse_of_any_lens_is_exact_where_it_says_valid(k1, k2, p, k3):
    camera = Camera(26.0, 25.0, 17.0, 12.0, 26, 35, (k1, k2, *p, k3))
    xy, valid = camera.normalised(camera.pixels())
    assert np.isfinite(xy).all()
    np.testing.assert_allclose(camera.project(xy)[valid], camera.pixels()[valid], atol=1e-5)
    assert valid[12, 17]


def test_pinhole_by_hand():
    xy, valid = PINHOLE.normalised(np.array([[170.0, 120.0], [370.0, 120.0], [170.0, 25.0]]))
    assert xy.tolist() == [[0, 0], [1, 0], [0, -0.5]]
    assert valid.all()


def test_any_leading_dimensions():
    camera = camera_with(*LENSES[0])
    px = np.random.default_rng(1).uniform(0, 250, (4, 3, 2, 2))
    xy, valid = camera.normalised(px)
    one_xy, one_valid = camera.normalised(px[2, 1, 0])
    assert xy.shape == px.shape and valid.shape == px.shape[:-1] and one_valid.shape == ()
    np.testing.assert_allclose(xy[2, 1, 0], one_xy, atol=1e-12)
    np.testing.assert_allclose(camera.project(xy)[0, 2, 1], px[0, 2, 1], atol=1e-9)


@pytest.mark.parametrize(("lens", "distortion"), LENSES)
def test_points_count_as_seen_up_to_where_the_bent_radius_first_shrinks(lens, distortion):
    camera = (
        Camera(1.0, 1.0, 0.0, 0.0, 260, 346, distortion[:2] + (0.0, 0.0) + distortion[4:], lens)
        if (lens == "radtan")
        else Camera(1.0, 1.0, 0.0, 0.0, 260, 346, distortion, lens)
    )
    along = np.linspace(0, 3, 30_001)
    points = np.stack((along, np.zeros_like(along)), axis=-1)
    shrinks = np.flatnonzero(np.diff(seen_by_opencv(camera, points)[:, 0]) < 0)
    first = along[shrinks[0]] if len(shrinks) else np.inf
    seen = camera.sees(points)
    assert seen[along < first - 1e-3].all()
    assert not seen[along > first + 1e-3].any()


def test_fisheye_sees_less_than_half_of_all_directions():
    camera = camera_with("fisheye", (), focal_px=100.0)
    xy, valid = camera.normalised(np.array([[170.0 + 100.0 * np.radians(angle), 120.0] for angle in (45, 85, 91, 120)]))
    assert valid.tolist() == [True, True, False, False]
    np.testing.assert_allclose(xy[:2, 0], np.tan(np.radians([45, 85])))


def test_a_seventh_of_a_real_calibration_is_not_monotonic(shared_data):
    name = "calibration_camera_DAVIS346_00000133-2021_03_02_17_44_07.xml"
    camera = load_camera(shared_data(f"recordings/davis346_ball_person/{name}"))
    _, valid = camera.normalised(camera.pixels())
    assert 1 - valid.mean() == pytest.approx(0.14, abs=0.005)
    assert valid[100:160, 100:200].all() and not valid[0, -1]


def test_convention_pixels_are_column_then_row():
    pixels = PINHOLE.pixels()
    assert pixels.shape == (260, 346, 2)
    assert pixels[3, 7].tolist() == [7, 3]


def test_convention_camera_axes_are_right_down_forward():
    px = PINHOLE.project(np.array([[0.1, 0.0], [0.0, 0.1]]))
    assert px.tolist() == [[190, 120], [170, 139]]


def test_convention_resizing_keeps_the_borders_of_the_image_half_a_pixel_out():
    small = PINHOLE.resized(130, 173)
    assert small.size == (130, 173)
    borders = np.array([[-0.5, -0.5], [345.5, 259.5]])
    np.testing.assert_allclose(small.project(PINHOLE.normalised(borders)[0]), [[-0.5, -0.5], [172.5, 129.5]])


@pytest.mark.parametrize(
    "wrong",
    [{"fx": 0.0}, {"fy": -1.0}, {"cx": float("nan")}, {"height": 0}, {"distortion": (0.1,)}],
    ids=str,
)
def test_impossible_cameras_are_refused(wrong):
    right = {"fx": 200.0, "fy": 200.0, "cx": 9.0, "cy": 9.0, "height": 20, "width": 20}
    with pytest.raises(BadInput):
        Camera(**(right | wrong))


def test_assumed_camera_is_centred_and_says_that_it_is_a_guess():
    with pytest.warns(EvimoWarning, match="no calibration"):
        camera = assumed_camera((180, 240))
    assert (camera.fx, camera.fy, camera.size, camera.is_pinhole) == (180, 180, (180, 240), True)
    corners, _ = camera.normalised(np.array([[-0.5, -0.5], [239.5, 179.5]]))
    np.testing.assert_allclose(corners[0], -corners[1])
