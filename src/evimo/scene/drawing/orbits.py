"""Curves of what never rests: round and to and fro about a middle, and turned the way it goes."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F8 = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Orbit:
    """An ellipse gone round for ever; with half axes of one order it is nowhere slow.

    across, along: (3,) rates at phases 0 and a quarter, per second. hz: rounds per second. phase: at time zero, rad.
    start: (3,) where the value is zero, from the ellipse's middle; zeros for values about the middle.
    """

    across: F8
    along: F8
    hz: float
    phase: float
    start: F8

    def __call__(self, time_s: F8) -> tuple[F8, F8]:
        """Value and rate at each time."""
        angle = (2 * math.pi * self.hz * np.asarray(time_s, np.float64) + self.phase)[:, None]
        value = (self.across * np.sin(angle) - self.along * np.cos(angle)) / (2 * math.pi * self.hz)
        return value - self.start, self.across * np.cos(angle) + self.along * np.sin(angle)


@dataclass(frozen=True, slots=True)
class Heading:
    """Rotation vectors about the vertical of what faces the way it goes on a level orbit, from facing `across`.

    ratio: of the rates `along` and `across`, negative for clockwise. hz, phase: of the orbit.
    """

    ratio: float
    hz: float
    phase: float

    def __call__(self, time_s: F8) -> tuple[F8, F8]:
        """Value and rate at each time."""
        turn = 2 * math.pi * self.hz
        angle = turn * np.asarray(time_s, np.float64) + self.phase
        k, (cos, sin) = abs(self.ratio), (np.cos(angle), np.sin(angle))
        ahead = angle + np.arctan2((k - 1) * sin * cos, cos**2 + k * sin**2)
        up = np.array([0.0, 0.0, math.copysign(1.0, self.ratio)])
        return ahead[:, None] * up, (turn * k / (cos**2 + k * k * sin**2))[:, None] * up
