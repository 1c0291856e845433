"""An inertial measurement unit at the camera: exact rotation and specific force, then white noise and bias."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.recordings.imu import Imu
from evimo.scene.motion import GRAVITY, Motion

F8 = NDArray[np.float64]

STEP_S = 1e-5  # accelerations are differences of exact velocities over twice this: right to 1e-5 m/s²


@dataclass(frozen=True, kw_only=True)
class ImuSettings:
    """Rate and errors of an inertial measurement unit; the same in all three axes.

    rate_hz:  samples per second.
    gyro_noise, accel_noise: white, density in rad/s/√Hz and m/s²/√Hz.
    gyro_walk, accel_walk:   of the bias, density in rad/s²/√Hz and m/s³/√Hz.
    gyro_bias, accel_bias:   standard deviation of the bias at the start, rad/s and m/s².

    The densities are those of EuRoC's sensor file (ADIS16448), rounded; the biases at the start are assumed.
    """

    rate_hz: float = 1000.0
    gyro_noise: float = 1.7e-4
    accel_noise: float = 2e-3
    gyro_walk: float = 1.9e-5
    accel_walk: float = 3e-3
    gyro_bias: float = 0.01
    accel_bias: float = 0.1


def measured(motion: Motion, seconds: float, settings: ImuSettings, rng: np.random.Generator) -> Imu:
    """Samples of a camera's motion from time zero on, up to `seconds`."""
    times_us = np.rint(np.arange(int(seconds * settings.rate_hz + 1e-6) + 1) * (1e6 / settings.rate_hz))
    spin, force = rotation_and_force(motion, times_us * 1e-6)
    gyro_error, gyro_bias = _errors(
        rng, spin.shape, settings.rate_hz, (settings.gyro_noise, settings.gyro_walk, settings.gyro_bias)
    )
    accel_error, accel_bias = _errors(
        rng, spin.shape, settings.rate_hz, (settings.accel_noise, settings.accel_walk, settings.accel_bias)
    )
    values = (spin + gyro_error, force + accel_error, gyro_bias, accel_bias)
    return Imu(times_us.astype(np.int64), *(value.astype(np.float32) for value in values))


def rotation_and_force(motion: Motion, time_s: F8) -> tuple[F8, F8]:
    """Angular velocity (T, 3) rad/s and specific force (T, 3) m/s² of a body's origin, in its own axes, exact."""
    poses = motion.at(time_s)
    change = motion.at(time_s + STEP_S).velocity - motion.at(time_s - STEP_S).velocity
    force = change / (2 * STEP_S) - np.array(GRAVITY)
    return poses.spin, np.einsum("tji,tj->ti", poses.rotation, force)


def _errors(
    rng: np.random.Generator, shape: tuple[int, ...], rate_hz: float, densities: tuple[float, float, float]
) -> tuple[F8, F8]:
    """Noise and bias together, and the bias alone, (T, 3) each, of densities (white, walk, spread at the start)."""
    white, walk, start = densities
    steps = rng.normal(size=shape) * walk / np.sqrt(rate_hz)  # a walk's variance grows by walk² per second
    steps[0] = rng.normal(size=shape[1:]) * start
    bias = np.cumsum(steps, axis=0)
    return bias + rng.normal(size=shape) * white * np.sqrt(rate_hz), bias  # white over the band up to rate / 2
