import numpy as np
import pytest

from evimo.streaming.regions import regions, smallest_region

SIZE = (60, 80)


def disc(cx: float, cy: float, radius: float) -> np.ndarray:
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    return (x - cx) ** 2 + (y - cy) ** 2 <= radius**2


def moving_with(*parts: tuple[np.ndarray, tuple[float, float, float]], noise: float = 0.0, seed: int = 0):
    """Union of masks, later ones in front, and the velocity of each."""
    velocity = np.random.default_rng(seed).normal(0, noise, (3, *SIZE)) if noise else np.zeros((3, *SIZE))
    moving = np.zeros(SIZE, np.bool_)
    base = np.zeros((3, *SIZE))
    for mask, motion in parts:
        moving |= mask
        base[:, mask] = np.array(motion)[:, None]
    return moving, (velocity + base).astype(np.float32)


def found(moving, velocity, smallest_px=12):
    return regions(moving, velocity, smallest_px=smallest_px)


def test_smallest_region_is_a_share_of_the_image_and_some_pixels_at_least():
    assert smallest_region((130, 173)) == 22  # 0.1 % of 22 490
    assert smallest_region((24, 32)) == 4


def test_nothing_moves():
    assert not found(*moving_with()).any()


def test_everything_moves():
    labels = found(np.ones(SIZE, np.bool_), np.zeros((3, *SIZE), np.float32))
    assert (labels == 1).all()


def test_separate_regions_are_numbered_by_size():
    small, large = disc(15, 30, 5), disc(55, 30, 12)
    labels = found(*moving_with((small, (1, 0, 0)), (large, (1, 0, 0))))
    np.testing.assert_array_equal(labels, large + 2 * small)


def test_crumbs_are_no_objects():
    moving = disc(40, 30, 8)
    moving[5, 5:16] = True  # eleven pixels
    moving[50, 5:17] = True  # twelve
    labels = found(moving, np.zeros((3, *SIZE), np.float32))
    assert labels[5, 5] == 0
    assert labels[50, 5] == 2


@pytest.mark.parametrize(("gap_px", "count"), [(0, 1), (2, 1), (4, 2), (8, 2)])
def test_a_narrow_gap_does_not_cut(gap_px, count):
    moving = np.zeros(SIZE, np.bool_)
    moving[20:40, 10:30] = moving[20:40, 30 + gap_px : 45] = True
    labels = found(moving, np.zeros((3, *SIZE), np.float32))
    assert labels.max() == count
    np.testing.assert_array_equal(labels > 0, moving)


def test_a_narrow_gap_between_two_motions_does():
    left, right = np.zeros(SIZE, np.bool_), np.zeros(SIZE, np.bool_)
    left[20:40, 10:30] = right[20:40, 32:50] = True
    labels = found(*moving_with((left, (1, 0, 0)), (right, (-1, 0, 0))))
    np.testing.assert_array_equal(labels, left + 2 * right)


def test_regions_that_touch_at_a_corner_are_one():
    moving = np.zeros(SIZE, np.bool_)
    moving[10:20, 10:20] = moving[20:30, 20:30] = True
    assert set(np.unique(found(moving, np.zeros((3, *SIZE), np.float32)))) == {0, 1}


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_two_that_touch_and_move_apart_are_two(noise):
    left, right = disc(32, 30, 10), disc(48, 30, 9)
    labels = found(*moving_with((left, (-1, 0, 0)), (right, (1, 0, 0.5)), noise=noise))
    assert (labels[left & ~right] == 1).mean() > 0.99
    assert (labels[right] == 2).mean() > 0.99


@pytest.mark.parametrize("noise", [0.05, 0.3])
def test_two_that_touch_and_move_alike_are_one(noise):
    labels = found(*moving_with((disc(32, 30, 10), (1, 0, 0)), (disc(48, 30, 9), (1.1, 0, 0)), noise=noise))
    assert labels.max() == 1


def test_noise_of_slow_ones_does_not_cut():
    left, right = disc(32, 30, 10), disc(48, 30, 9)
    assert found(*moving_with((left, (-0.04, 0, 0)), (right, (0.04, 0, 0)))).max() == 1


def test_a_speck_is_not_cut_out():
    large, speck = disc(40, 30, 25), disc(45, 30, 4)
    assert found(*moving_with((large, (1, 0, 0)), (speck, (-1, 0, 0)), noise=0.05)).max() == 1


def test_a_turning_body_is_not_cut():
    """Its velocities spread evenly, they do not form two groups."""
    body = disc(40, 30, 20)
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    velocity = np.stack((-(y - 30) / 20, (x - 40) / 20, np.zeros(SIZE))).astype(np.float32)
    assert found(body, velocity).max() == 1
    assert found(body, velocity + np.float32(0.3)).max() == 1


def test_three_in_a_row_are_three():
    parts = [(disc(20, 30, 11), (-1, 0, 0)), (disc(40, 30, 11), (0, 1, 0)), (disc(60, 30, 11), (1, -1, 0))]
    labels = found(*moving_with(*parts))
    middles = {int(labels[30, x]) for x in (15, 40, 65)}
    assert middles == {1, 2, 3}


def test_a_small_one_in_front_of_a_large_one_is_cut_out():
    large, small = disc(40, 30, 22), disc(45, 30, 5)
    labels = found(*moving_with((large, (1, 0, 0)), (small, (-1, 0, 0)), noise=0.05))
    assert (labels[small] == 2).mean() > 0.95
    assert (labels[large & ~small] == 1).mean() > 0.99


def test_scattered_outliers_do_not_cut():
    body = disc(40, 30, 20)
    moving, velocity = moving_with((body, (1, 0, 0)), noise=0.02)
    velocity[:, ::7, ::7] = -1
    assert found(moving, velocity).max() == 1


def test_no_more_regions_than_fit_in_a_byte():
    moving = np.zeros((200, 300), np.bool_)
    moving[::12, ::12] = moving[::12, 1::12] = True  # 425 of two pixels
    labels = regions(moving, np.zeros((3, 200, 300), np.float32), smallest_px=2)
    assert len(np.unique(labels)) == 256
