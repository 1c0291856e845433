import numpy as np
import pytest

from evimo.geometry.camera import Camera
from evimo.geometry.rectification import rectified
from evimo.streaming.inference import Answer
from evimo.streaming.objects import ObjectFinder

SIZE, HALF_SIZE = (48, 64), (24, 32)


def half(size):
    return tuple(-(-side // 2) for side in size)


def answer_of(size, *, moving, rel_depth=None, velocity=None) -> Answer:
    return Answer(
        moving=moving.astype(np.float32),
        rel_depth=np.ones(size, np.float32) if rel_depth is None else rel_depth,
        ego=np.arange(6.0),
        velocity=np.zeros((3, *size), np.float32) if velocity is None else velocity,
        flow=np.stack((np.full(size, 2, np.float32), np.full(size, 3, np.float32))),
        confidence=np.full(size, 0.25, np.float32),
    )


@pytest.fixture
def pinhole():
    return rectified(Camera(50.0, 50.0, 31.5, 23.5, *SIZE))


def test_a_box_is_measured(pinhole):
    moving = np.zeros(HALF_SIZE)
    moving[5:10, 15:22] = 0.9
    moving[5:10, 15:17] = 0.6
    depth = np.tile(np.linspace(0.5, 2, 32, dtype=np.float32), (24, 1))
    velocity = np.zeros((3, *HALF_SIZE), np.float32)
    velocity[1] = np.where(moving == np.float32(0.6), 1.0, 1.2)
    velocity[2, moving == 0.6] = 0.4
    estimate = ObjectFinder(pinhole).estimate(
        answer_of(HALF_SIZE, moving=moving, rel_depth=depth, velocity=velocity), start_us=50_000, stop_us=75_000
    )
    assert (estimate.t_us, estimate.start_us, estimate.stop_us) == (62_500, 50_000, 75_000)
    assert estimate.confidence.shape == SIZE and (estimate.confidence == 0.25).all()
    (box,) = estimate.objects
    assert box.id == 1
    np.testing.assert_allclose(box.box, (30, 10, 43, 19), atol=1)  # the mask is interpolated between half-size pixels
    assert box.area_px == pytest.approx(140, rel=0.1)
    np.testing.assert_allclose(box.centroid, (36.5, 14.5), atol=0.7)  # 0.6 reaches less far beyond its pixels than 0.9
    assert box.rel_distance == pytest.approx(np.interp(36.5, np.arange(32) * 2 + 0.5, depth[0]), rel=0.02)
    assert box.rel_velocity[2] == pytest.approx(0.4 * 0.6 * 2 / (0.6 * 2 + 0.9 * 5), rel=1e-5)
    np.testing.assert_array_equal(estimate.ids == 1, estimate.moving)
    np.testing.assert_allclose(estimate.flow[:, 5, 5], (2, 3))
    assert estimate.ego.tolist() == [0, 1, 2, 3, 4, 5]
    assert estimate.valid.all()


def test_median_of_an_even_and_an_odd_count(pinhole):
    depth = np.random.default_rng(0).random(HALF_SIZE, np.float32)
    for width in (3, 4):
        moving = np.zeros(HALF_SIZE, np.bool_)
        moving[5:8, 10 : 10 + width] = True
        estimate = ObjectFinder(pinhole).estimate(
            answer_of(HALF_SIZE, moving=moving, rel_depth=depth), start_us=0, stop_us=25_000
        )
        inside = estimate.rel_depth[estimate.ids == 1]
        assert estimate.objects[0].rel_distance == pytest.approx(np.median(inside), rel=1e-5)


def test_a_larger_sensor_gets_its_own_pixels():
    rectification = rectified(Camera(400.0, 400.0, 399.5, 299.5, 600, 800))
    size = rectification.image.size
    moving = np.zeros(half(size), np.bool_)
    moving[50:55, 100:110] = True
    estimate = ObjectFinder(rectification).estimate(answer_of(half(size), moving=moving), start_us=0, stop_us=25_000)
    assert estimate.ids.shape == estimate.moving.shape == (600, 800)
    scale = 800 / size[1]
    (box,) = estimate.objects
    np.testing.assert_allclose(box.box, (200 * scale, 100 * scale, 220 * scale - 1, 110 * scale - 1), atol=2)
    assert box.area_px == pytest.approx(200 * scale**2, rel=0.07)
    np.testing.assert_allclose(box.centroid, (210 * scale - 0.5, 105 * scale - 0.5), atol=1)


def test_pixels_without_a_counterpart_hold_no_object():
    rectification = rectified(Camera(30.0, 30.0, 31.5, 23.5, *SIZE, distortion=(-0.5, 0.1, 0.0, 0.0)))
    assert not rectification.valid.all()
    moving = np.ones(half(rectification.image.size), np.bool_)
    estimate = ObjectFinder(rectification).estimate(answer_of(moving.shape, moving=moving), start_us=0, stop_us=25_000)
    assert not estimate.ids[~rectification.valid].any()
    assert (estimate.ids > 0)[rectification.valid].mean() > 0.99  # all but crumbs at the border of what is valid
    np.testing.assert_array_equal(estimate.moving, rectification.valid)


def test_ids_follow_an_object_that_moves(pinhole):
    finder = ObjectFinder(pinhole)
    for step in range(10):
        moving = np.zeros(HALF_SIZE, np.bool_)
        moving[5:10, 2 * step : 2 * step + 4] = True
        moving[15:20, 20 - 2 * step : 26 - 2 * step] = True
        estimate = finder.estimate(answer_of(HALF_SIZE, moving=moving), start_us=0, stop_us=25_000)
        assert {one.id: round(one.centroid[1], 1) for one in estimate.objects} == {1: 34.5, 2: 14.5}
    assert finder.objects_seen == 2
