"""How bodies and the camera move: smooth random curves with exact derivatives, so that twists are exact."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

F8 = NDArray[np.float64]
Curve = Callable[[F8], tuple[F8, F8]]
"""Times (T,) in s to values (T, 3) and their rates of change (T, 3)."""

TERMS = 6  # sines per curve
GRAVITY = (0.0, 0.0, -9.81)


def cross_matrix(vector: F8) -> F8:
    """The matrices (..., 3, 3) whose product with u is the cross product of `vector` (..., 3) and u."""
    x, y, z = np.moveaxis(np.asarray(vector, np.float64), -1, 0)
    zero = np.zeros_like(x)
    rows = [zero, -z, y, z, zero, -x, -y, x, zero]
    return np.stack(rows, axis=-1).reshape(*x.shape, 3, 3)


def rotation_from_vector(vector: F8) -> F8:
    """Rotation vectors (..., 3) in rad to matrices (..., 3, 3): Rodrigues' formula."""
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    cross = cross_matrix(vector)
    half = np.sinc(angle / (2 * np.pi))
    return np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * half**2 * (cross @ cross)


def right_jacobian(vector: F8) -> F8:
    """J (..., 3, 3) with body angular velocity = J · d(vector)/dt, for R = rotation_from_vector(vector)."""
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    cross = cross_matrix(vector)
    half = np.sinc(angle / (2 * np.pi))
    small = angle < 1e-3  # there (a - sin a) / a³ cancels; its series does not
    safe = np.where(small, 1.0, angle)
    cubic = np.where(small, 1 / 6 - angle**2 / 120, (safe - np.sin(safe)) / safe**3)
    return np.eye(3) - 0.5 * half**2 * cross + cubic * (cross @ cross)


@dataclass(frozen=True, slots=True)
class Wander:
    """A band-limited random curve: a sum of sines.

    frequency: (N, 3) Hz. phase: (N, 3) rad. amplitude: (N, 3) of the *rate*, per second.
    zero_s: the time at which the value is zero.
    """

    frequency: F8
    phase: F8
    amplitude: F8
    zero_s: float = 0.0

    def __call__(self, time_s: F8) -> tuple[F8, F8]:
        """Value and rate at each time."""
        turn = 2 * np.pi * self.frequency
        angle = turn * np.asarray(time_s, np.float64)[:, None, None] + self.phase
        start = turn * self.zero_s + self.phase
        value = (self.amplitude / turn * (np.sin(angle) - np.sin(start))).sum(axis=-2)
        return value, (self.amplitude * np.cos(angle)).sum(axis=-2)


def wander(rng: np.random.Generator, rms_rate: float, band_hz: tuple[float, float], *, zero_s: float = 0.0) -> Wander:
    """A random curve whose rate has the given root mean square (norm of three axes), frequencies log-uniform."""
    frequency = np.exp(rng.uniform(math.log(band_hz[0]), math.log(band_hz[1]), (TERMS, 3)))
    amplitude = rng.normal(size=(TERMS, 3))
    amplitude *= rms_rate / math.sqrt(0.5 * (amplitude**2).sum())
    return Wander(frequency, rng.uniform(0, 2 * np.pi, (TERMS, 3)), amplitude, zero_s)


@dataclass(frozen=True, slots=True)
class Throw:
    """A body thrown, at its place at time `at_s`: velocity (3,) m/s there, and gravity."""

    velocity: F8
    at_s: float

    def __call__(self, time_s: F8) -> tuple[F8, F8]:
        """Displacement and velocity at each time."""
        since = (np.asarray(time_s, np.float64) - self.at_s)[:, None]
        gravity = np.array(GRAVITY)
        return self.velocity * since + 0.5 * gravity * since**2, self.velocity + gravity * since


@dataclass(frozen=True, slots=True)
class Rest:
    """Time stands still between `start_s` and `stop_s`; it stops and starts again over `ramp_s` each."""

    start_s: float
    stop_s: float
    ramp_s: float

    def clock(self, time_s: F8) -> tuple[F8, F8]:
        """The body's own time and its pace (0 at rest, 1 otherwise)."""
        slowed, slowing = self._step(time_s, self.start_s)
        resumed, resuming = self._step(time_s, self.stop_s)
        return time_s - slowed + resumed, 1 - slowing + resuming

    def _step(self, time_s: F8, begin_s: float) -> tuple[F8, F8]:
        """The integral of a smooth step that begins at `begin_s`, and the step."""
        since = (np.asarray(time_s, np.float64) - begin_s) / self.ramp_s
        x = np.clip(since, 0, 1)
        return self.ramp_s * (x**3 - 0.5 * x**4 + np.maximum(since - 1, 0)), 3 * x**2 - 2 * x**3


@dataclass(frozen=True, slots=True)
class Pauses:
    """Several rests that do not overlap, ramps included."""

    rests: tuple[Rest, ...]

    def clock(self, time_s: F8) -> tuple[F8, F8]:
        """The body's own time and its pace, as `Rest.clock`."""
        each = [rest.clock(time_s) for rest in self.rests]
        lost = sum((time_s - own for own, _ in each), np.zeros_like(time_s))
        stopped = sum((1 - pace for _, pace in each), np.zeros_like(time_s))
        return time_s - lost, 1 - stopped


class Poses(NamedTuple):
    """Where a body is at T times, and how it moves.

    rotation: (T, 3, 3) world_from_body. position: (T, 3) of its origin in the world, m.
    velocity: (T, 3) of its origin, world axes, m/s. spin: (T, 3) angular velocity, *body* axes, rad/s.
    """

    rotation: F8
    position: F8
    velocity: F8
    spin: F8


@dataclass(frozen=True, slots=True)
class Motion:
    """A rigid body that wanders about a mean pose.

    position: (3,) m and rotation: (3, 3), the mean pose in the world.
    moves:    curves added to the position. turns: a curve of rotation vectors in body axes, or none.
    rest:     when it stands still.
    """

    position: F8
    rotation: F8
    moves: Sequence[Curve] = ()
    turns: Curve | None = None
    rest: Rest | Pauses | None = None

    def at(self, time_s: F8) -> Poses:
        """Poses at times (T,) in s."""
        time = np.atleast_1d(np.asarray(time_s, np.float64))
        own, pace = self.rest.clock(time) if self.rest else (time, np.ones_like(time))
        position, velocity = np.tile(self.position, (len(time), 1)), np.zeros((len(time), 3))
        for curve in self.moves:
            value, rate = curve(own)
            position, velocity = position + value, velocity + rate * pace[:, None]
        vector, rate = self.turns(own) if self.turns else (np.zeros((len(time), 3)),) * 2
        spin = np.einsum("tij,tj->ti", right_jacobian(vector), rate) * pace[:, None]
        return Poses(self.rotation @ rotation_from_vector(vector), position, velocity, spin)


def looking_at(position: F8, target: F8) -> F8:
    """Camera axes (x right, y down, z forward) as columns, for a world whose z is up."""
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    return np.stack((right, np.cross(forward, right), forward), axis=1)


def random_rotation(rng: np.random.Generator) -> F8:
    """A rotation matrix drawn evenly."""
    w, x, y, z = (q := rng.normal(size=4)) / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def axes_along(way: F8) -> F8:
    """Axes as columns whose third is the unit vector `way`."""
    aside = cross_matrix(way)[:, np.argmin(np.abs(way))]
    aside = aside / np.linalg.norm(aside)
    return np.stack((aside, np.cross(way, aside), way), axis=1)


def turned(angle: float) -> F8:
    """A rotation about the world's vertical, rad."""
    return rotation_from_vector(np.array([0.0, 0.0, angle]))
