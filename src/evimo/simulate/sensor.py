"""Settings of one sensor: thresholds, speed, noise, light; fixed by hand or drawn at random."""

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True)
class SensorSettings:
    """An event camera in some light. The defaults are a clean DAVIS346 in daylight.

    contrast:     threshold C in ln(irradiance), geometric mean of both polarities. on_over_off: C+ / C-.
    mismatch:     spread of thresholds between pixels, relative to C.
    refractory_s: a pixel is blind after each event; its reference is taken anew at the end.
    bandwidth_hz: of the photoreceptor at white, proportional to irradiance; 0 is infinitely fast.
    floor:        irradiance that is always there (dark current, stray light), white is 1.
    shot_hz:      noise events per pixel in the dark, a quarter of it at white. leak_hz: ON events per pixel by leakage.
    hot_share:    share of pixels that fire at 10 to 200 Hz. jitter_s: standard deviation of timestamps.
    flicker_hz, flicker_depth: of lamps, 0 where steady. blur_px: standard deviation of the lens's point spread.
    """

    contrast: float = 0.3
    on_over_off: float = 1.0
    mismatch: float = 0.04
    refractory_s: float = 0.001
    bandwidth_hz: float = 500.0
    floor: float = 0.003
    shot_hz: float = 0.1
    leak_hz: float = 0.1
    hot_share: float = 0.0
    jitter_s: float = 30e-6
    flicker_hz: float = 100.0
    flicker_depth: float = 0.0
    blur_px: float = 0.55


WHITE = 0.6  # irradiance at which `bandwidth_hz` holds
SHOT_DROP = 0.75  # how much rarer noise is at white than in the dark


def draw_sensor(rng: np.random.Generator, *, dark: bool = False) -> SensorSettings:
    """Settings spread around a DAVIS346 in normal light, or in the dark."""
    high = rng.random() < 0.1
    flicker = rng.random() < (0.5 if dark else 0.08)
    return SensorSettings(
        contrast=log_uniform(rng, 0.6, 1.0) if high else log_uniform(rng, 0.15, 0.6),
        on_over_off=math.exp(rng.normal() * 0.2),
        mismatch=float(rng.uniform(0.02, 0.15)),
        refractory_s=float(rng.choice([0, 0.0005, 0.001, 0.0015, 0.002], p=[0.1, 0.2, 0.3, 0.25, 0.15])),
        bandwidth_hz=log_uniform(rng, 40, 200) if dark else log_uniform(rng, 200, 2000),
        floor=float(rng.uniform(0.02, 0.08)) if dark else 0.003,
        shot_hz=log_uniform(rng, 1, 8) if dark else log_uniform(rng, 0.01, 0.3),
        leak_hz=log_uniform(rng, 0.03, 0.3),
        hot_share=float(rng.uniform(0, 5e-4)),
        jitter_s=float(rng.uniform(0, 100e-6)),
        flicker_hz=float(rng.choice([100, 120])),
        flicker_depth=float(rng.uniform(0.05, 0.4)) if flicker else 0.0,
        blur_px=float(rng.uniform(0.45, 0.9)),
    )


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return math.exp(rng.uniform(math.log(low), math.log(high)))
