import numpy as np
import pytest

from evimo.geometry.camera import Camera
from evimo.viewing.pixel_flow import PixelFlow

PINHOLE = Camera(200.0, 210.0, 33.0, 25.0, 48, 64)
RADTAN = Camera(60.0, 62.0, 33.0, 25.0, 48, 64, (-0.3, 0.08, 0.002, -0.001))
FISHEYE = Camera(40.0, 40.0, 33.0, 25.0, 48, 64, (0.02, -0.004, 0.0, 0.0), "fisheye")


def test_a_pinhole_multiplies_by_its_focal_lengths():
    flow = np.random.default_rng(0).normal(size=(2, 48, 64))
    px = PixelFlow(PINHOLE).px(flow)
    np.testing.assert_allclose(px, np.stack((200 * flow[0], 210 * flow[1]), axis=-1), rtol=1e-6)


@pytest.mark.parametrize("camera", [PINHOLE, RADTAN, FISHEYE])
def test_pixels_go_where_the_points_go(camera):
    moved = PixelFlow(camera)
    flow, dt_s = np.random.default_rng(1).normal(size=(2, 48, 64)), 1e-5
    later = camera.project(np.moveaxis(moved.grid + flow * dt_s, 0, -1))
    _, seen = camera.normalised(camera.pixels())
    np.testing.assert_allclose((camera.pixels() + moved.px(flow) * dt_s)[seen], later[seen], atol=2e-6)
    assert seen.mean() > 0.9


def test_pixels_without_a_direction_stay_finite():
    strong = Camera(20.0, 20.0, 33.0, 25.0, 48, 64, (-0.4, 0.0, 0.0, 0.0))
    moved = PixelFlow(strong)
    assert not strong.normalised(strong.pixels())[1].all()
    assert np.isfinite(moved.px(np.ones((2, 48, 64)))).all()
