import numpy as np
import pytest

from evimo.events.stack import StaticMotion
from evimo.training import disturbance
from evimo.training.disturbance import disturbed

SIZE = (40, 60)


@pytest.fixture
def truth():
    twist = np.tile(np.array((0.03, -0.02, 0.01, 0.01, -0.02, 0.015), np.float32), (5, 1))
    inv_depth = np.random.default_rng(5).uniform(0.5, 2, SIZE).astype(np.float32)
    return StaticMotion(twist, inv_depth, 4, np.array((200, 200, 120, 80), np.float32))


@pytest.fixture
def errors(truth, monkeypatch):
    """Errors of the twist (N, 5, 6) and of log inverse depth (N, H, W) of many draws at a level."""

    def drawn(level, *, known_rotation=False, count=300):
        monkeypatch.setattr(disturbance, "LEVELS", (level, level))
        rng = np.random.default_rng(0)
        found = [disturbed(truth, rng, known_rotation=known_rotation) for _ in range(count)]
        assert all(one.step == truth.step and one.intrinsics is truth.intrinsics for one in found)
        twists = np.stack([one.twist - truth.twist for one in found])
        return twists, np.stack([np.log(one.inv_depth / truth.inv_depth) for one in found])

    return drawn


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def test_without_errors_it_is_the_truth(errors, truth, monkeypatch):
    monkeypatch.setattr(disturbance, "FLAT", 0)
    twist, depth = errors(1e-7, count=3)
    np.testing.assert_allclose(twist, 0, atol=1e-7)
    np.testing.assert_allclose(depth, 0, atol=1e-5)


def test_errors_grow_with_their_level_and_the_speed(errors, truth):
    low, high = (rms(errors(level)[0][..., :3]) for level in (0.03, 0.3))
    assert high == pytest.approx(10 * low, rel=0.05)
    speed = np.linalg.norm(truth.twist[0, :3])
    # A common error and one of 0.4 of it for each slice, 0.35 of the speed at level 1.
    assert high == pytest.approx(0.3 * 0.35 * speed * np.hypot(1, 0.4), rel=0.1)


def test_most_of_an_error_is_common_to_all_slices(errors):
    twist, _ = errors(0.3)
    common = twist[..., :3].mean(1)
    own = twist[..., :3] - common[:, None]
    assert 0.2 < rms(own) / rms(common) < 0.5


def test_translation_is_traded_for_rotation(errors):
    """An error along x looks like one of yaw, one along y like one of pitch; flow is -vx - wy and -vy + wx."""
    twist, _ = errors(0.3)
    vx, vy, wx, wy = (twist[..., axis].ravel() for axis in (0, 1, 3, 4))
    assert np.corrcoef(vx, wy)[0, 1] < -0.7
    assert np.corrcoef(vy, wx)[0, 1] > 0.7
    assert rms(vx + wy) < 0.6 * rms(vx)


def test_a_known_rotation_is_nearly_right(errors):
    told, untold = (errors(1.0, known_rotation=known)[0] for known in (True, False))
    assert rms(told[..., 3:]) < 0.05 * rms(untold[..., 3:])
    assert rms(told[..., :3]) == pytest.approx(rms(untold[..., :3]), rel=0.15)


def test_a_wrong_camera_is_seen_to_move_less(errors, truth):
    """On average it moves slower than the true one, by up to 0.3 of it at level 1."""
    twist, _ = errors(1.0, count=2000)
    along = (twist[..., :3] @ truth.twist[0, :3]).mean() / np.square(truth.twist[0, :3]).sum()
    assert along == pytest.approx(-0.15, abs=0.04)


def test_some_depths_are_flat_and_the_others_have_bumps(errors, truth):
    _, depth = errors(0.5, count=1000)
    flat = (np.abs(depth + np.log(truth.inv_depth)) < 1e-6).all((1, 2))
    assert flat.mean() == pytest.approx(0.12, abs=0.04)
    bumps = depth[~flat]
    assert 0.1 < rms(bumps) < 0.35
    assert rms(np.diff(bumps, axis=2)) < 0.3 * rms(bumps)  # smooth


def test_a_camera_at_rest_is_seen_to_move_a_little(truth):
    still = truth._replace(twist=np.zeros((5, 6), np.float32))
    rng = np.random.default_rng(0)
    twist = np.stack([disturbed(still, rng, known_rotation=False).twist for _ in range(300)])
    assert 1e-4 < rms(twist[..., :3]) < 4e-3


def test_levels_are_drawn_evenly_in_their_logarithm(truth):
    rng = np.random.default_rng(0)
    found = [disturbed(truth, rng, known_rotation=True).twist - truth.twist for _ in range(600)]
    sizes = np.array([rms(one[:, 2]) for one in found])
    low, middle, high = np.quantile(sizes, (0.15, 0.5, 0.85))
    assert high / low > 10
    assert middle == pytest.approx(np.sqrt(low * high), rel=0.5)
