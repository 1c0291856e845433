"""Surfaces: which texture, how large, how much contrast."""

import math
from dataclasses import dataclass

import numpy as np

from evimo.scene.bodies import Surface
from evimo.scene.textures import TextureBank

DARKEST, BRIGHTEST = 0.03, 0.95


@dataclass(frozen=True, slots=True)
class Paint:
    """A family of surfaces.

    plain:    share of surfaces without visible pattern.
    contrast: range of ln(bright / dark) of a pattern. period: range of its size in m, log-uniform.
    """

    bank: TextureBank
    plain: float
    contrast: tuple[float, float]
    period: tuple[float, float]

    def surface(self, rng: np.random.Generator, *, plain: float | None = None) -> Surface:
        """One surface; `plain` overrides the family's share."""
        kinds = self.bank.plain if rng.random() < (self.plain if plain is None else plain) else self.bank.dense
        depth = rng.uniform(*self.contrast)
        dark = math.exp(rng.uniform(math.log(DARKEST), math.log(BRIGHTEST) - min(depth, 2.0)))
        period = math.exp(rng.uniform(*np.log(self.period)))
        shift = (float(rng.random()), float(rng.random()))
        return Surface(int(rng.choice(kinds)), period, shift, dark, min(BRIGHTEST, dark * math.exp(depth)))
