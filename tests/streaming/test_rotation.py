"""What is known of the camera's rotation, from gyroscopes of known motion."""

import numpy as np
import pytest

from evimo.events.gyroscope import Gyroscope
from evimo.streaming.inference import Network
from evimo.streaming.pipeline import Run
from evimo.streaming.rotation import rotation_of

CENTRES = 1_012_500 + 25_000 * np.arange(112)  # of slices within three seconds
AXES = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])  # camera from gyroscope


def turning(t_us):
    """Angular velocity (..., 3) of a hand-held camera, rad/s, camera axes."""
    swings = [(1.3, 0.2), (0.9, 1.1), (1.9, 2.0)]
    return np.stack([np.sin(2e-6 * np.pi * hz * t_us + phase) for hz, phase in swings], axis=-1) * (0.6, 0.9, 0.4)


def gyroscope(*, in_camera_axes):
    """A kilohertz of it from 1 to 4 s; in its own axes with a bias."""
    t_us = np.arange(1_000_000, 4_000_001, 1000)
    rate = turning(t_us) if in_camera_axes else turning(t_us) @ AXES + (0.05, -0.08, 0.03)
    return Gyroscope(t_us, rate, in_camera_axes, "made up")


def mean_turning(start_us):
    return turning(start_us + 500.0 * np.arange(50) + 250).mean(axis=0)


def never():
    raise AssertionError("asked for what is not needed")


@pytest.fixture
def recording(discs, recorded):
    return lambda found: recorded(discs, read_gyroscope=lambda: found)


def test_without_a_gyroscope_nothing_is_known(recording):
    rotation = rotation_of(recording(None), never)
    assert rotation.of_slice(1_000_000, 1_025_000).tolist() == [0, 0, 0, 0]
    assert rotation.said == "the recording has no gyroscope"


def test_one_in_camera_axes_gives_its_mean_in_each_slice(recording):
    rotation = rotation_of(recording(gyroscope(in_camera_axes=True)), never)
    for start_us in (1_000_000, 2_350_000, 3_975_000):
        found = rotation.of_slice(start_us, start_us + 25_000)
        assert found.dtype == np.float32
        np.testing.assert_allclose(found, [*(0.025 * mean_turning(start_us)), 1], atol=1e-5)
    assert rotation.said == "made up, in camera axes"


@pytest.mark.parametrize("start_us", [975_000, 3_999_000, 9_000_000])
def test_outside_its_samples_nothing_is_known(recording, start_us):
    rotation = rotation_of(recording(gyroscope(in_camera_axes=True)), never)
    assert rotation.of_slice(start_us, start_us + 25_000).tolist() == [0, 0, 0, 0]


def test_one_in_its_own_axes_is_aligned_by_what_is_seen_and_keeps_its_scale(recording):
    """Networks see less rotation than there is: here two thirds of it."""
    asked = []

    def seen():
        asked.append(1)
        noise = np.random.default_rng(0).normal(size=(len(CENTRES), 3)) * 0.02
        return CENTRES.tolist(), np.stack([mean_turning(centre - 12_500) for centre in CENTRES]) * 2 / 3 + noise

    rotation = rotation_of(recording(gyroscope(in_camera_axes=False)), seen)
    assert asked == [1]
    found = np.stack([rotation.of_slice(centre - 12_500, centre + 12_500) for centre in CENTRES[4:-4]])
    expected = np.stack([mean_turning(centre - 12_500) for centre in CENTRES[4:-4]])
    assert (found[:, 3] == 1).all()
    np.testing.assert_allclose(found[:, :3] / 0.025, expected, atol=0.05)
    assert "axes x = gy, y = -gx, z = gz" in rotation.said and "scale 1.000" in rotation.said


def test_one_that_cannot_be_aligned_is_not_used(recording):
    def seen():
        return CENTRES.tolist(), np.random.default_rng(0).normal(size=(len(CENTRES), 3))

    rotation = rotation_of(recording(gyroscope(in_camera_axes=False)), seen)
    assert rotation.of_slice(2_000_000, 2_025_000).tolist() == [0, 0, 0, 0]
    assert "cannot be told" in rotation.said


def test_switched_off_it_is_not_even_read(discs, recorded, fake_network, camera):
    prepared = Run(recorded(discs, read_gyroscope=never), Network(fake_network), camera=camera, imu="off")
    assert prepared.rotation.of_slice(2_000_000, 2_025_000).tolist() == [0, 0, 0, 0]
    assert prepared.rotation.said == "off"
