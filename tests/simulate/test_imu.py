"""The inertial measurement unit, against the stored poses, differentiated, and against motions worked out by hand."""

import numpy as np
import pytest

from evimo.recordings.recording import open_recording
from evimo.recordings.writer import RecordingWriter
from evimo.scene.motion import Motion, Throw, looking_at
from evimo.simulate.imu import ImuSettings, measured
from evimo.simulate.plan import RecordingPlan
from evimo.simulate.recording import simulate_recording

SILENT = ImuSettings(gyro_noise=0, accel_noise=0, gyro_walk=0, accel_walk=0, gyro_bias=0, accel_bias=0)
RIGHT, DOWN, FORWARD = np.eye(3)
NORTHWARDS = looking_at(np.zeros(3), np.array([0.0, 1.0, 0.0]))  # level, in a world whose z is up


@pytest.fixture(scope="module", params=[(7, 3), (11, 4), (2, 6)], ids=str)
def stored(request, tmp_path_factory):
    """A recording on disk whose inertial unit is without errors."""
    seed, number = request.param
    film = simulate_recording(RecordingPlan(seed=seed, set_number=number, seconds=0.2, size=(33, 44)))
    folder = tmp_path_factory.mktemp("imu") / "film"
    with RecordingWriter(folder, film.camera, poses=film.poses, imu=film.imu(SILENT)) as writer:
        for piece in film:
            writer.write(piece.events, piece.truth)
    return open_recording(folder)


def differences(values, step_s):
    """First and second derivatives of rows two and more from the ends, right to the fourth order."""
    a, b, c, d, e = (values[k : len(values) - 4 + k] for k in range(5))
    return (a - 8 * b + 8 * d - e) / (12 * step_s), (-a + 16 * b - 30 * c + 16 * d - e) / (12 * step_s**2)


def test_gyro_and_accelerometer_are_the_derivatives_of_the_stored_poses(stored):
    with np.load(stored.path / "dataset_sim.npz", allow_pickle=False) as sim:
        times_us, world_from_cam = sim["trajectory_us"], sim["trajectory_world_from_cam"]
    step_s = (times_us[1] - times_us[0]) * 1e-6
    assert step_s == 0.005
    turn, place = world_from_cam[:, :3, :3], world_from_cam[:, :3, 3]
    cam_from_world = turn[2:-2].swapaxes(1, 2)
    spin = cam_from_world @ differences(turn, step_s)[0]  # skew: how the axes turn, seen in the axes
    expected = np.stack((spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]), axis=1)
    at = np.searchsorted(stored.imu.t_us, times_us[2:-2])
    np.testing.assert_array_equal(stored.imu.t_us[at], times_us[2:-2])
    np.testing.assert_allclose(stored.imu.gyro[at], expected, atol=1e-3)
    assert np.abs(expected).max() > 0.05
    held_up = differences(place, step_s)[1] + (0, 0, 9.81)  # what keeps it from falling, world axes, z up
    expected = np.einsum("tij,tj->ti", cam_from_world, held_up)
    error = np.abs(stored.imu.accel[at] - expected).max(axis=1)
    assert np.percentile(error, 80) < 1e-4
    assert error.max() < 0.05  # where a camera comes to rest or starts again: the poses are too far apart for it
    assert np.abs(expected - expected.mean(axis=0)).max() > 0.05


def test_gyro_is_the_stored_ego_rotation(stored):
    ego = np.array([stored.truth(k).ego for k in range(len(stored))])
    between = np.array([np.interp(stored.times_us, stored.imu.t_us, axis) for axis in stored.imu.gyro.T]).T
    np.testing.assert_allclose(between, ego[:, 3:], atol=1e-3)


def test_a_camera_at_rest_feels_what_holds_it_up():
    imu = measured(Motion(np.zeros(3), NORTHWARDS), 0.1, SILENT, np.random.default_rng(0))
    assert (len(imu), imu.t_us[0], imu.t_us[-1], imu.t_us[1]) == (101, 0, 100_000, 1_000)
    np.testing.assert_allclose(imu.accel, np.tile(-9.81 * DOWN, (101, 1)), atol=1e-6)
    np.testing.assert_array_equal(imu.gyro, 0)


def test_convention_turning_right_is_positive_about_the_axis_that_points_down():
    def clockwise(time_s):
        """Rotation vectors in camera axes: half a radian per second to the right, which the y axis (down) counts."""
        return np.outer(0.5 * time_s, DOWN), np.tile(0.5 * DOWN, (len(time_s), 1))

    motion = Motion(np.zeros(3), NORTHWARDS, turns=clockwise)
    looks_at = motion.at(np.array([1.0])).rotation[0] @ FORWARD
    assert looks_at[0] > 0.4  # east of north
    imu = measured(motion, 0.1, SILENT, np.random.default_rng(0))
    np.testing.assert_allclose(imu.gyro, np.tile(0.5 * DOWN, (101, 1)), atol=1e-6)


def test_a_circle_is_felt_towards_its_centre_and_a_fall_not_at_all():
    def circle(time_s):
        """Radius 0.5 m, 3 rad/s in the world's plane x z, seen from the point at angle zero."""
        sine, cosine, zero = np.sin(3 * time_s), np.cos(3 * time_s), np.zeros_like(time_s)
        return 0.5 * np.stack((cosine, zero, sine), 1), 1.5 * np.stack((-sine, zero, cosine), 1)

    imu = measured(Motion(np.zeros(3), NORTHWARDS, moves=(circle,)), 0.1, SILENT, np.random.default_rng(0))
    np.testing.assert_allclose(imu.accel[0], (-0.5 * 3**2, -9.81, 0), atol=1e-5)  # the centre lies left, in the west
    thrown = Motion(np.zeros(3), NORTHWARDS, moves=(Throw(np.array([1.0, 2.0, 3.0]), at_s=0.0),))
    np.testing.assert_allclose(measured(thrown, 0.1, SILENT, np.random.default_rng(0)).accel, 0, atol=1e-5)


def test_noise_has_the_stated_densities():
    still, settings = Motion(np.zeros(3), NORTHWARDS), ImuSettings(rate_hz=500)
    imu = measured(still, 200, settings, np.random.default_rng(1))
    for name, value, at_rest in (("gyro", imu.gyro, 0 * DOWN), ("accel", imu.accel, -9.81 * DOWN)):
        white, walk = getattr(settings, f"{name}_noise"), getattr(settings, f"{name}_walk")
        bias = getattr(imu, f"{name}_bias").astype(float)
        noise = value - at_rest - bias
        spectrum = np.abs(np.fft.rfft(noise, axis=0)) ** 2 / (len(noise) * 500)  # two-sided, per Hz
        for low, high in ((1, 25_000), (25_000, 50_000)):
            assert np.sqrt(spectrum[low:high].mean()) == pytest.approx(white, rel=0.02)
        per_second = bias[500::500] - bias[:-500:500]
        assert per_second.std() == pytest.approx(walk, rel=0.1)
        assert abs(noise.mean()) < 5 * white / np.sqrt(200)


def test_bias_at_the_start_has_the_stated_spread():
    still, settings = Motion(np.zeros(3), NORTHWARDS), ImuSettings()
    starts = [measured(still, 0.001, settings, np.random.default_rng(seed)) for seed in range(300)]
    assert np.std([imu.gyro_bias[0] for imu in starts]) == pytest.approx(settings.gyro_bias, rel=0.1)
    assert np.std([imu.accel_bias[0] for imu in starts]) == pytest.approx(settings.accel_bias, rel=0.1)


def test_a_seed_gives_its_own_errors_again():
    one, again, other = (
        simulate_recording(RecordingPlan(seed=seed, seconds=0.1, size=(33, 44))).imu() for seed in (3, 3, 4)
    )
    for name, values in one.arrays().items():
        np.testing.assert_array_equal(values, again.arrays()[name])
    assert (one.gyro_bias[0] != other.gyro_bias[0]).all()
