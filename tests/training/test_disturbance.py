import numpy as np
import pytest

from evimo.events.stack import StaticMotion
from evimo.training import disturbance as module
from evimo.training.disturbance import disturbed


@pytest.fixture
def truth():
    rng = np.random.default_rng(0)
    twist = (rng.normal(size=(1, 6)) * 0.02 + rng.normal(size=(5, 6)) * 0.002).astype(np.float32)
    inv_depth = rng.uniform(0.4, 2, (9, 14)).astype(np.float32)
    return StaticMotion(twist, inv_depth, 4, np.array((40, 40, 27, 18), np.float32))


@pytest.fixture
def at_level(monkeypatch, truth):
    """Errors (twist, log of depth) of `count` compensations of one size of error."""

    def errors(level, *, known_rotation=False, count=1, seed=0):
        monkeypatch.setattr(module, "LEVELS", (level, level))
        monkeypatch.setattr(module, "FLAT", 0)
        monkeypatch.setattr(module, "SMOOTH", (0.01, 0.01))
        rng = np.random.default_rng(seed)
        found = [disturbed(truth, rng, known_rotation=known_rotation) for _ in range(count)]
        twists = np.stack([motion.twist - truth.twist for motion in found])
        return twists, np.stack([np.log(motion.inv_depth / truth.inv_depth) for motion in found])

    return errors


def test_a_tiny_error_is_nearly_the_truth(at_level, truth):
    twist, depth = at_level(1e-3)
    assert 0 < np.abs(twist).max() < 0.002 * np.abs(truth.twist).max()
    assert 0 < np.abs(depth).max() < 0.005


def test_errors_grow_with_the_level(at_level):
    small, large = at_level(0.1, count=20), at_level(0.2, count=20)
    np.testing.assert_allclose(large[0], 2 * small[0], atol=1e-6, rtol=1e-3)
    np.testing.assert_allclose(large[1], 2 * small[1], atol=1e-5, rtol=1e-3)


def test_levels_are_drawn_evenly_in_their_logarithm(truth, monkeypatch):
    monkeypatch.setattr(module, "SMOOTH", (0.01, 0.01))
    rng = np.random.default_rng(0)
    sizes = []
    for _ in range(400):
        motion = disturbed(truth, rng, known_rotation=False)
        if not (motion.inv_depth == 1).all():
            sizes.append(np.log(motion.inv_depth / truth.inv_depth).std())
    low, middle, high = np.quantile(sizes, (0.1, 0.5, 0.9))
    assert high / low > 20
    assert low * high == pytest.approx(middle**2, rel=0.35)  # the median is half way in the logarithm


def test_a_known_rotation_is_nearly_right(at_level):
    known, unknown = (at_level(1.0, known_rotation=known, count=50)[0] for known in (True, False))
    assert np.abs(known[..., 3:]).mean() < 0.06 * np.abs(unknown[..., 3:]).mean()
    assert np.abs(known[..., :3]).mean() > 0.7 * np.abs(unknown[..., :3]).mean()


def test_rotation_makes_up_for_most_of_a_wrong_translation(at_level):
    """At the mean depth, in the middle of the image, x flows by -vx - wy, and y by -vy + wx."""
    error = at_level(1.0, count=200)[0].mean(axis=1)
    translation, both = error[:, :2], error[:, :2] + np.stack((error[:, 4], -error[:, 3]), axis=1)
    assert np.linalg.norm(both, axis=0).max() < 0.6 * np.linalg.norm(translation, axis=0).min()


def test_slices_share_most_of_their_error(at_level):
    error = at_level(1.0, count=100)[0][..., :3]
    shared, own = error.mean(axis=1).std(), (error - error.mean(axis=1, keepdims=True)).std()
    assert 0.2 * shared < own < 0.6 * shared


def test_some_compensations_have_a_flat_depth(truth):
    rng = np.random.default_rng(0)
    flat = [(disturbed(truth, rng, known_rotation=False).inv_depth == 1).all() for _ in range(500)]
    assert np.mean(flat) == pytest.approx(0.12, abs=0.04)


def test_a_camera_at_rest_is_seen_to_move(at_level, truth):
    truth.twist[:] = 0
    assert 0 < np.abs(at_level(1.0)[0]).max() < 0.02


def test_the_truth_itself_is_left_alone(truth):
    before = truth.twist.copy(), truth.inv_depth.copy()
    motion = disturbed(truth, np.random.default_rng(0), known_rotation=False)
    np.testing.assert_array_equal(truth.twist, before[0])
    np.testing.assert_array_equal(truth.inv_depth, before[1])
    assert motion.twist.dtype == motion.inv_depth.dtype == np.float32


def test_depth_has_no_sharper_outlines_than_a_first_pass_sees(monkeypatch, truth):
    """A wall with a box before it: most compensations know the box's outline only roughly."""
    wall = np.full((40, 60), 0.5, np.float32)
    wall[12:28, 20:40] = 2
    monkeypatch.setattr(module, "LEVELS", (1e-3, 1e-3))
    monkeypatch.setattr(module, "FLAT", 0)
    rng = np.random.default_rng(0)
    found = [disturbed(truth._replace(inv_depth=wall), rng, known_rotation=False).inv_depth for _ in range(60)]
    steps = [np.abs(np.diff(np.log(depth[20]))).max() / np.log(4) for depth in found]
    assert np.median(steps) < 0.15
    assert max(steps) > 0.4
    assert all(depth.min() > 0.49 and depth.max() < 2.01 for depth in found)
