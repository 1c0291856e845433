"""Surfaces: a share of patterns is too faint for event pixels, the others are not."""

import numpy as np

from evimo.scene.drawing.paint import FAINT, Paint
from evimo.scene.textures.bank import texture_bank
from evimo.simulate.sensor import SENSORS


def test_patterns_are_faint_or_strong_but_not_near_the_thresholds():
    paint = Paint(texture_bank(0, plain=2, dense=4), 0.0, (1.2, 2.5), (0.1, 0.5))
    rng = np.random.default_rng(0)
    surfaces = [paint.surface(rng) for _ in range(2000)]
    change = np.array([np.log(surface.bright / surface.dark) for surface in surfaces])
    low, high = SENSORS["davis346"].contrast
    faint = change < 0.5
    assert abs(faint.mean() - FAINT) < 0.04
    assert np.median(change[faint]) < low
    assert change[faint].max() < 0.5 * high
    assert change[~faint].min() > 2 * high
    assert max(surface.bright for surface in surfaces) <= 1
