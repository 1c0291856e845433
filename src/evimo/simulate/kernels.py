# pyright: basic
"""The event pixel, compiled: exact on a log signal that is piecewise linear in time.

Pixels are worked through in bands of rows, each with its own room for events, so the answer does not depend on the
number of threads. Random numbers are per pixel.
"""

import math

import numba
import numpy as np

BAND = 8  # rows
NEVER = 1e30

_jit = numba.njit(nogil=True, error_model="numpy", cache=True)
_inlined = numba.njit(nogil=True, error_model="numpy", cache=True, inline="always")
_parallel = numba.njit(nogil=True, error_model="numpy", cache=True, parallel=True)


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
def begin_step(i, interval, level, pixels):
    """Bring pixel i to a level in a straight line over an interval (start, stop), if surely nothing happens in it.

    Returns:
        Slope of level minus reference, 1/s, and whether that was all. If not, ask `next_event`.
    """
    start, stop = interval
    step = stop - start
    slope = (level - pixels.level[i]) / step + pixels.leak[i] * pixels.on[i]
    gap = pixels.gap[i] + slope * step
    pixels.level[i] = level
    calm = pixels.blind[i] <= start and pixels.noise[i] > stop and gap < pixels.on[i] and gap > -pixels.off[i]
    if calm:
        pixels.gap[i] = gap
    return slope, calm


@_jit
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
def _band(band, time_s, signal, lag, decay, pixels, settings, out):
    """All frames of one band of pixels; returns the number of events."""
    per_band = BAND * settings.width
    first, last = band * per_band, min(signal.shape[1], (band + 1) * per_band)
    count, room = 0, out.t.shape[1]
    for f in range(1, len(signal)):
        start, stop = time_s[f - 1], time_s[f]
        for i in range(first, last):
            level = np.float64(signal[f, i])
            if settings.lagging:
                level = low_passed(pixels.level[i], np.float64(signal[f - 1, i]), level, lag[f, i], decay[f, i])
            slope, calm = begin_step(i, (start, stop), level, pixels)
            if calm:
                continue
            now, stamp, sign = next_event(i, (start, stop), slope, pixels, settings)
            while sign != 0:
                if count < room:
                    out.t[band, count], out.pixel[band, count], out.p[band, count] = stamp, i, sign
                count += 1
                now, stamp, sign = next_event(i, (now, stop), slope, pixels, settings)
    return count


@_parallel
def events_of_frames(time_s, signal, lag, decay, pixels, settings, out):
    """Events between the first and the last frame; continues from, and updates, the state in `pixels`.

    Returns:
        Number of events of each band; what exceeds the room was not written.

    Args:
        time_s: (F,) of the frames, s; events carry the same clock, in µs.
        signal: (F, N) ln of irradiance; a row of the image is settings.width long.
        lag, decay: (F, N) of the low-pass in the step before each frame: tau / step and exp(-step / tau);
            (0, 0) for an infinitely fast pixel.
        pixels: `pixels.PixelState`. settings: `pixels.KernelSettings`. out: `pixels.EventRoom`, one row per band.
    """
    filled = np.zeros(len(out.t), np.int64)
    for band in numba.prange(len(filled)):
        filled[band] = _band(band, time_s, signal, lag, decay, pixels, settings, out)
    return filled


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
