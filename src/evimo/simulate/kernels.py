# pyright: basic
"""The event pixel, compiled: exact on a log signal that is piecewise linear in time.

One pixel's functions, shared by both processors (`bands`, `cuda_pixels`). Random numbers are per pixel.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.compiling import njit

NEVER = 1e30
F8 = NDArray[np.float64]

_jit = njit(nogil=True, error_model="numpy")
_inlined = njit(nogil=True, error_model="numpy", inline="always")


class PixelState(NamedTuple):
    """Per pixel (N,): constants and state.

    on, off: thresholds. leak, shot: Hz. level: low-passed signal. gap: level minus reference.
    blind: end of the dead time, s. noise: time of the next noise event, s. random: generator.
    fading: irradiance I thins noise to exp(-fading · I).
    """

    on: F8
    off: F8
    leak: F8
    shot: F8
    level: F8
    gap: F8
    blind: F8
    noise: F8
    random: NDArray[np.uint64]
    fading: F8


class KernelSettings(NamedTuple):
    """What the kernel needs of the settings."""

    width: int
    refractory: float
    jitter: float
    lagging: bool


@_jit
def uniform(state, i):
    """The next number in (0, 1) of pixel i's generator (xorshift64*)."""
    s = state[i]
    s ^= s >> np.uint64(12)
    s ^= s << np.uint64(25)
    s ^= s >> np.uint64(27)
    state[i] = s
    return (np.float64((s * np.uint64(2685821657736338717)) >> np.uint64(11)) + 0.5) * (1.0 / 9007199254740992.0)


@_jit
def _normal(state, i):
    return math.sqrt(-2 * math.log(uniform(state, i))) * math.cos(2 * math.pi * uniform(state, i))


@_inlined
def low_passed(old, before, after, lag, decay):
    """The photoreceptor's output, `old` one frame ago, after its input went in a straight line from before to after."""
    behind = (after - before) * lag
    return after - behind + (old - before + behind) * decay


@_inlined
def slope_to(level, old, step, leakage):
    """Slope of level minus reference, 1/s, while the level goes from old in a straight line."""
    return (level - old) / step + leakage


@_inlined
def is_calm(gap, thresholds, interval, times):
    """Whether a pixel surely does nothing in an interval (start, stop) at the end of which its gap is this.

    Args:
        thresholds: on and off. times: end of the dead time, and of the next noise event.
    """
    (on, off), (start, stop), (blind, noise) = thresholds, interval, times
    return (blind <= start) & (noise > stop) & (gap < on) & (gap > -off)


@_inlined
def begin_step(i, interval, level, pixels):
    """Bring pixel i to a level in a straight line over an interval (start, stop), if surely nothing happens in it.

    Returns:
        Slope of level minus reference, 1/s, and whether that was all. If not, ask `next_event`.
    """
    step = interval[1] - interval[0]
    slope = slope_to(level, pixels.level[i], step, pixels.leak[i] * pixels.on[i])
    gap = pixels.gap[i] + slope * step
    pixels.level[i] = level
    calm = is_calm(gap, (pixels.on[i], pixels.off[i]), interval, (pixels.blind[i], pixels.noise[i]))
    if calm:
        pixels.gap[i] = gap
    return slope, calm


@_inlined
def next_event(i, interval, slope, pixels, settings):
    """The next event of pixel i in an interval that begins where the last one stopped or the last event was.

    Returns:
        When it happens, s; its time stamp, µs, with jitter; its polarity, 0 if there is none: the state is at `stop`.
    """
    now, stop = interval
    on, off, rate = pixels.on[i], pixels.off[i], pixels.shot[i]
    gap, blind, noise = pixels.gap[i], pixels.blind[i], pixels.noise[i]
    while True:
        if blind > now:
            gap = 0.0  # the reference is taken anew at the end of the dead time
            if blind >= stop:
                break
            now = blind
        due, sign = NEVER, 0
        if slope > 0.0:
            due, sign = now + max(0.0, on - gap) / slope, 1
        elif slope < 0.0:
            due, sign = now + max(0.0, off + gap) / -slope, -1
        jitter = settings.jitter
        if noise < due and noise <= stop:
            darkness = math.exp(-pixels.fading[i] * math.exp(pixels.level[i]))
            heard = noise >= now and uniform(pixels.random, i) < darkness
            if heard:
                due, sign, jitter = noise, (1 if uniform(pixels.random, i) < 0.5 else -1), 0.0
            noise -= math.log(uniform(pixels.random, i)) / rate
            if not heard:
                continue
        elif due > stop:
            gap += slope * (stop - now)
            break
        stamp = due + jitter * _normal(pixels.random, i) if jitter > 0.0 else due
        blind = due + settings.refractory if settings.refractory > 0.0 else blind
        pixels.gap[i], pixels.blind[i], pixels.noise[i] = 0.0, blind, noise
        return due, round(stamp * 1e6), sign
    pixels.gap[i], pixels.blind[i], pixels.noise[i] = gap, blind, noise
    return stop, 0, 0


@_jit
def seeded(seed, number):
    """One generator state per pixel, (N,) uint64."""
    state = np.empty(number, np.uint64)
    for i in range(number):
        s = (
            np.uint64(seed) * np.uint64(0x9E3779B97F4A7C15)
            + np.uint64(i) * np.uint64(0xBF58476D1CE4E5B9)
            + np.uint64(1)
        )
        s ^= s >> np.uint64(31)
        s *= np.uint64(0x94D049BB133111EB)
        s ^= s >> np.uint64(29)
        state[i] = s | np.uint64(1)
    return state
