"""Ways in which hands and strings move things: tossed and caught, swinging, trembling, following what moves."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.scene.motion import GRAVITY, Curve, Motion, Wander, right_jacobian, rotation_from_vector, wander

F8 = NDArray[np.float64]
TREMOR_HZ = (5.0, 10.0)  # of hands
WIDEST_SWING = 0.5  # rad


@dataclass(frozen=True, slots=True)
class Toss:
    """Thrown up, caught and thrown back, for ever: position and velocity are continuous.

    velocity: (3,) m/s as it leaves the hand, upwards; the way back goes the other way sideways.
    catch_s:  for which a hand slows it down and throws it again, with constant force. start_s: of a throw.
    """

    velocity: F8
    catch_s: float
    start_s: float

    def __call__(self, time_s: F8) -> tuple[F8, F8]:
        """Displacement from the first hand, and velocity, at each time."""
        flight_s = 2 * self.velocity[2] / -GRAVITY[2]
        throw, since = np.divmod(np.asarray(time_s, np.float64) - self.start_s, flight_s + self.catch_s)
        flying, back = (since < flight_s)[:, None], (throw % 2 == 1)[:, None]
        caught = (since - flight_s)[:, None]
        since = since[:, None]
        turn = np.array([-1.0, -1.0, 1.0])  # what a throw back does differently
        gravity, push = np.array(GRAVITY), self.velocity * (turn - 1) / self.catch_s
        landing = self.velocity * np.array([1.0, 1.0, -1.0])
        push[2] = 2 * self.velocity[2] / self.catch_s
        far = self.velocity * np.array([1.0, 1.0, 0.0]) * flight_s
        value = np.where(
            flying,
            self.velocity * since + 0.5 * gravity * since**2,
            far + landing * caught + 0.5 * push * caught**2,
        )
        rate = np.where(flying, self.velocity + gravity * since, landing + push * caught)
        return np.where(back, far + value * turn, value), np.where(back, rate * turn, rate)


@dataclass(frozen=True, slots=True)
class Swing:
    """A point that turns rigidly about a pivot: where something on a string goes.

    arm: (3,) from the pivot to the point at rest, m. turns: rotation vectors about the pivot, world axes at rest.
    """

    arm: F8
    turns: Curve

    def __call__(self, time_s: F8) -> tuple[F8, F8]:
        """Displacement from rest, and velocity, at each time."""
        vector, rate = self.turns(time_s)
        turn = rotation_from_vector(vector)
        spin = np.einsum("tij,tj->ti", right_jacobian(vector), rate)
        return turn @ self.arm - self.arm, np.einsum("tij,tj->ti", turn, np.cross(spin, self.arm))


@dataclass(frozen=True, slots=True)
class Following:
    """A curve, and on top of it where something else is, seen from `leader.position`.

    Both go by the same clock: not for a `Motion` that rests.
    from_world: (3, 3), from that displacement in the world, m, to what is added to the curve.
    """

    curve: Curve
    leader: Motion
    from_world: F8

    def __call__(self, time_s: F8) -> tuple[F8, F8]:
        """Value and rate at each time."""
        (value, rate), leader = self.curve(time_s), self.leader.at(time_s)
        gone = leader.position - self.leader.position
        return value + gone @ self.from_world.T, rate + leader.velocity @ self.from_world.T


def pendulum(rng: np.random.Generator, length: float, speed: float, *, zero_s: float) -> Swing:
    """A thing on a string of this length, m, that passes its lowest point at `zero_s`; `speed` in m/s, rms."""
    own_hz = math.sqrt(-GRAVITY[2] / length) / (2 * math.pi)
    most = WIDEST_SWING * 2 * math.pi * own_hz
    way = rng.uniform(0, 2 * math.pi)
    sideways = np.array([math.cos(way), math.sin(way)]) * min(math.sqrt(2) * speed / length, most)
    frequency = np.array([[own_hz, own_hz * rng.uniform(0.97, 1.03), rng.uniform(0.1, 0.4)]])
    amplitude = np.array([[*sideways, rng.normal() * 0.6]])
    turns = Wander(frequency, -2 * np.pi * frequency * zero_s, amplitude, zero_s)
    return Swing(np.array([0.0, 0.0, -length]), turns)


def trembling(rng: np.random.Generator, curve: Wander, rms_rate: float) -> Wander:
    """The curve with a hand's tremor; `rms_rate` per second, of the tremor alone."""
    tremor = wander(rng, rms_rate, TREMOR_HZ, zero_s=curve.zero_s)
    return Wander(
        np.concatenate((curve.frequency, tremor.frequency)),
        np.concatenate((curve.phase, tremor.phase)),
        np.concatenate((curve.amplitude, tremor.amplitude)),
        curve.zero_s,
    )


def level(curve: Wander) -> Wander:
    """The same curve without its vertical part: sliding on a floor."""
    return Wander(curve.frequency, curve.phase, curve.amplitude * (1.0, 1.0, 0.0), curve.zero_s)


def upright(curve: Wander) -> Wander:
    """The same turning about the vertical alone."""
    return Wander(curve.frequency, curve.phase, curve.amplitude * (0.0, 0.0, 1.0), curve.zero_s)
