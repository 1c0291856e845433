"""Surfaces: which texture, how large, how much contrast."""

import math
from dataclasses import dataclass

import numpy as np

from evimo.scene.bodies import Surface
from evimo.scene.textures.bank import TextureBank

DARKEST, BRIGHTEST = 0.03, 0.95
FAINT = 0.3  # of patterned surfaces: what is on them stays below the thresholds of event pixels, as on real walls
FAINT_CONTRAST = (0.03, 0.2)
GLOSSY, GLOSS = 0.15, (0.1, 0.5)  # share of surfaces with a highlight, and the irradiance of its middle


@dataclass(frozen=True, slots=True)
class Paint:
    """A family of surfaces.

    plain:    share of surfaces without pattern.
    contrast: range of ln(bright / dark) of a pattern that is not faint; event pixels fire at each 0.2 to 0.4 of it.
    faint:    share of patterned surfaces that have hardly any contrast.
    period:   range of a pattern's size in m, log-uniform.
    """

    bank: TextureBank
    plain: float
    contrast: tuple[float, float]
    period: tuple[float, float]
    faint: float = FAINT

    def surface(self, rng: np.random.Generator, *, plain: float | None = None) -> Surface:
        """One surface; `plain` overrides the family's share."""
        kinds = self.bank.plain if rng.random() < (self.plain if plain is None else plain) else self.bank.dense
        depth = rng.uniform(*(FAINT_CONTRAST if rng.random() < self.faint else self.contrast))
        dark = math.exp(rng.uniform(math.log(DARKEST), math.log(BRIGHTEST) - min(depth, 2.0)))
        period = math.exp(rng.uniform(*np.log(self.period)))
        shift = (float(rng.random()), float(rng.random()))
        bright, gloss = min(BRIGHTEST, dark * math.exp(depth)), rng.uniform(*GLOSS) if rng.random() < GLOSSY else 0.0
        return Surface(int(rng.choice(kinds)), period, shift, dark, bright, float(gloss))
