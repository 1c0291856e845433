"""Settings of one sensor: thresholds, speed, noise, light; fixed by hand or drawn at random for one kind of camera."""

import math
from dataclasses import dataclass

import numpy as np

from evimo.errors import BadInput

Range = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class SensorSettings:
    """An event camera in some light. The defaults are a clean DAVIS346 in daylight.

    contrast:     threshold C in ln(irradiance), geometric mean of both polarities. on_over_off: C+ / C-.
    mismatch:     spread of thresholds between pixels, relative to C.
    refractory_s: a pixel is blind after each event; its reference is taken anew at the end.
    bandwidth_hz: of the photoreceptor at white, proportional to irradiance; 0 is infinitely fast.
    floor:        irradiance that is always there (dark current, stray light), white is 1.
    shot_hz:      noise events per pixel without light; irradiance `shot_light` thins them to 1/e.
    leak_hz:      ON events per pixel by leakage.
    patches, spread: how uneven shot_hz and leak_hz are, in logarithms: over the sensor, and from pixel to pixel.
    hot_share:    share of pixels that fire at 10 Hz to hot_hz, log-uniform, as far as the refractory period lets them.
    jitter_s:     standard deviation of timestamps.
    flicker_hz, flicker_depth: of lamps, 0 where steady. blur_px: standard deviation of the lens's point spread.
    tick_us:      step of the readout's clock: times are whole multiples of it.
    """

    contrast: float = 0.3
    on_over_off: float = 1.0
    mismatch: float = 0.04
    refractory_s: float = 0.001
    bandwidth_hz: float = 500.0
    floor: float = 0.003
    shot_hz: float = 0.1
    shot_light: float = 0.05
    leak_hz: float = 0.01
    patches: float = 0.4
    spread: float = 0.35
    hot_share: float = 0.0
    hot_hz: float = 9000.0
    jitter_s: float = 30e-6
    flicker_hz: float = 100.0
    flicker_depth: float = 0.0
    blur_px: float = 0.55
    tick_us: int = 1


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """A kind of event camera: its size, and what its pixels' settings are drawn from. The defaults are a DAVIS346.

    size:       height and width, px.
    contrast:   log-uniform, like all that are not said to be otherwise.
    on_bias:    mean of ln(C+ / C-), 0 where both polarities fire alike.
    bandwidth_hz, shot_hz, shot_light: in normal light, and dark_bandwidth_hz, ... in the dark.
    hot_share, jitter_s: uniform.
    """

    size: tuple[int, int] = (260, 346)
    contrast: Range = (0.16, 0.42)
    on_bias: float = -0.18
    refractory_s: Range = (0.0005, 0.0015)
    bandwidth_hz: Range = (200, 2000)
    dark_bandwidth_hz: Range = (40, 200)
    shot_hz: Range = (0.01, 5)
    dark_shot_hz: Range = (1, 8)
    shot_light: Range = (0.03, 0.08)
    dark_shot_light: Range = (0.3, 1.0)
    leak_hz: Range = (0.002, 0.1)
    hot_share: Range = (0, 2e-4)
    jitter_s: Range = (0, 100e-6)
    tick_us: int = 1


# Of a DAVIS346: C reaches from the least that others carried over to real cameras to the most in two real clips, whose
# frames say by how much light changes from one event of a pixel to the next: ON 0.37 and 0.34, OFF 0.41 and 0.30. Their
# pixels at rest in the light fire only by leakage, 0.0035 Hz; black ones 0.01 Hz in the sun, several Hz indoors. Hot
# ones fire at up to 9 kHz; intervals of the others begin at 0.7 and 0.9 ms. Of both 52 % are ON; with this
# `on_bias` so are those of recordings with moving cameras (median of 90; with alike thresholds 48 %).
# What other sensors do otherwise. Refractory periods are about the shortest intervals of one pixel in a
# real clip of each: 1.6 and 1.1 ms (DAVIS240C), 0.2 to 0.4 ms (DVXplorer), 0.4 ms (Gen4).
# C of 0.16 to 0.34 is what others trained with for Prophesee's and Samsung's sensors and carried over to real ones.
# Events of a Samsung sensor come in bursts 0.1 ms apart, of a Prophesee on a clock of 1 µs.
CARRIED, QUICK = (0.16, 0.34), (0.0001, 0.0005)
SENSORS = {
    "davis346": Sensor(),
    "davis240": Sensor(size=(180, 240), on_bias=0.3, refractory_s=(0.001, 0.002)),
    "dvxplorer": Sensor(
        size=(480, 640),
        contrast=CARRIED,
        on_bias=0.0,
        refractory_s=QUICK,
        hot_share=(0, 1e-3),
        jitter_s=(30e-6, 150e-6),
    ),
    "gen4": Sensor(size=(720, 1280), contrast=CARRIED, on_bias=0.0, refractory_s=(0.0002, 0.001), jitter_s=(0, 30e-6)),
    "samsung": Sensor(
        size=(480, 640),
        contrast=CARRIED,
        on_bias=0.0,
        refractory_s=QUICK,
        jitter_s=(0, 50e-6),
        tick_us=100,
    ),
}
WHITE = 0.6  # irradiance at which `bandwidth_hz` holds


def known_sensor(name: str) -> Sensor:
    """One of `SENSORS`.

    Raises:
        BadInput: there is no such sensor.
    """
    if name not in SENSORS:
        raise BadInput(f"no sensor {name!r}", fix=f"one of {', '.join(SENSORS)}")
    return SENSORS[name]


def draw_sensor(rng: np.random.Generator, *, dark: bool = False, sensor: str = "davis346") -> SensorSettings:
    """Settings spread around a sensor in normal light, or in the dark."""
    kind = known_sensor(sensor)
    flicker = rng.random() < (0.5 if dark else 0.08)
    return SensorSettings(
        contrast=log_uniform(rng, *kind.contrast),
        on_over_off=math.exp(kind.on_bias + rng.normal() * 0.2),
        mismatch=float(rng.uniform(0.02, 0.15)),
        refractory_s=log_uniform(rng, *kind.refractory_s),
        bandwidth_hz=log_uniform(rng, *(kind.dark_bandwidth_hz if dark else kind.bandwidth_hz)),
        floor=float(rng.uniform(0.02, 0.08)) if dark else 0.003,
        shot_hz=log_uniform(rng, *(kind.dark_shot_hz if dark else kind.shot_hz)),
        shot_light=log_uniform(rng, *(kind.dark_shot_light if dark else kind.shot_light)),
        leak_hz=log_uniform(rng, *kind.leak_hz),
        patches=float(rng.uniform(0.2, 0.6)),
        spread=float(rng.uniform(0.2, 0.45)),
        hot_share=float(rng.uniform(*kind.hot_share)),
        jitter_s=float(rng.uniform(*kind.jitter_s)),
        flicker_hz=float(rng.choice([100, 120])),
        flicker_depth=float(rng.uniform(0.05, 0.4)) if flicker else 0.0,
        blur_px=float(rng.uniform(0.45, 0.9)),
        tick_us=kind.tick_us,
    )


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return math.exp(rng.uniform(math.log(low), math.log(high)))
