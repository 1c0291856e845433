import threading

import numpy as np
import pytest

from evimo.events.events import Events
from evimo.events.slices import Slice
from evimo.events.stack import voxel_grid
from evimo.geometry.camera import Camera
from evimo.geometry.rectification import rectified
from evimo.streaming.inference import CameraMotion
from evimo.streaming.looks import Looks, Placed, stacked
from evimo.streaming.rotation import UNKNOWN

BARREL = Camera(12.0, 12.0, 15.5, 11.5, 24, 32, distortion=(-0.5, 0.1, 0.0, 0.0))


def slice_of(x, y, t, p, *, index=3):
    columns = (np.array(each, kind) for each, kind in zip((x, y, t, p), ("u2", "u2", "i8", "i1"), strict=True))
    return Slice(index, 25_000 * index, 25_000 * (index + 1), Events(*columns))


@pytest.fixture
def pinhole(camera):
    return rectified(camera)


def test_without_a_lens_events_stay_in_their_pixels(pinhole):
    placed = Placed(pinhole).slice(slice_of([3, 31], [5, 23], [75_000, 93_750], [1, -1]))
    np.testing.assert_allclose(placed.x, (3, 31), atol=1e-4)
    np.testing.assert_allclose(placed.y, (5, 23), atol=1e-4)
    np.testing.assert_allclose(placed.t, (-0.5, 0.25))
    assert placed.positive.tolist() == [True, False]


def test_events_without_a_place_are_counted(pinhole):
    placed = Placed(pinhole)
    assert len(placed.slice(slice_of([3, 32, 4], [5, 5, 24], [75_000] * 3, [1, 1, 1])).x) == 1  # off the sensor
    assert placed.dropped == 2
    placed.slice(slice_of([40], [0], [75_000], [1]))
    assert placed.dropped == 3


def test_events_that_the_lens_has_no_counterpart_of_are_counted():
    lens = rectified(BARREL)
    y, x = (each.ravel() for each in np.mgrid[:24, :32])
    placed = Placed(lens)
    found = placed.slice(slice_of(x, y, np.full(len(x), 80_000), np.ones(len(x))))
    assert placed.dropped == (~lens.valid).sum() > 0
    assert len(found.x) == lens.valid.sum()


def test_a_stack_has_the_time_of_its_middle(pinhole):
    placed = Placed(pinhole)
    parts = [placed.slice(slice_of([k], [k], [25_000 * k + 12_500], [1], index=k)) for k in range(5)]
    whole = stacked(parts)
    np.testing.assert_allclose(whole.t, (-2, -1, 0, 1, 2))
    np.testing.assert_allclose(whole.x, range(5), atol=1e-4)


def test_missing_slices_leave_a_gap(pinhole):
    part = Placed(pinhole).slice(slice_of([1], [2], [75_000 + 12_500], [1]))
    assert stacked([None, None, part, None, part]).t.tolist() == [0, 2]
    assert stacked([None] * 5).t.shape == (0,)
    assert stacked([None] * 5).positive.dtype == np.bool_


def test_images_are_padded_to_the_stride(pinhole):
    looks = Looks(pinhole, stride=20)
    assert (looks.size, looks.cells) == ((40, 40), (20, 20))
    stack = stacked([Placed(pinhole).slice(slice_of([8], [6], [87_500], [1]))])
    first = looks.first(stack, UNKNOWN)
    assert (first.voxels.shape, first.fits.shape, first.valid.shape) == ((30, 20, 20), (24, 20, 20), (20, 20))
    assert (first.valid[:12, :16] == 1).all() and first.valid.sum() == 12 * 16
    assert first.rotation.tolist() == [0, 0, 0, 0]
    still = CameraMotion(np.ones((10, 10), np.float32), np.zeros(6, np.float32), np.zeros((2, 10, 10), np.float32))
    second = looks.second(stack, looks.static_motion([still] * 5), UNKNOWN)
    assert second.voxels.shape == (30, 40, 40)
    np.testing.assert_array_equal(second.voxels, voxel_grid(stack, (40, 40)))


def test_each_slices_own_motion_is_taken_out(pinhole, camera):
    """A dot that goes 1 px to the right per slice, at twice the mean depth; the outer slices see it twice as fast."""
    place = Placed(pinhole)
    columns = [10, 12, 13, 14, 16]
    stack = stacked([place.slice(slice_of([c], [8], [87_500], [1])) for c in columns])
    speeds = np.array((2, 1, 1, 1, 2)) * -2.0 / camera.fx
    # From centre to centre of neighbours is half the one's and half the other's motion: 1.5 px from the outer ones.
    stack = stack._replace(x=stack.x + np.array((0.5, 0, 0, 0, -0.5), np.float32))
    depth = np.full((8, 8), 2, np.float32)
    motions = [
        CameraMotion(depth, np.array((v, 0, 0, 0, 0, 0), np.float32), np.zeros((2, 8, 8), np.float32)) for v in speeds
    ]
    looks = Looks(pinhole, stride=8)
    sharp = np.expm1(looks.second(stack, looks.static_motion(motions), UNKNOWN).voxels).sum(0)
    assert sharp[8, 13] == pytest.approx(5, abs=1e-3)
    assert sharp.sum() == pytest.approx(5, abs=1e-3)


def test_threads_do_not_share_memory(pinhole):
    looks = Looks(pinhole, stride=8)
    stack = stacked([Placed(pinhole).slice(slice_of([8], [6], [87_500], [1]))])
    found = [looks.first(stack, UNKNOWN).voxels]
    thread = threading.Thread(target=lambda: found.append(looks.first(stack, UNKNOWN).voxels))
    thread.start()
    thread.join()
    assert not np.shares_memory(*found)
    assert np.shares_memory(found[0], looks.first(stack, UNKNOWN).voxels)
