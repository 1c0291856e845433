# pyright: basic
"""Event pixels on the CPU, compiled: through all instants, a stretch of pixels at a time.

Pixels are worked through in bands of rows, each with its own room for events, so the answer does not depend on the
number of threads. What happens to all pixels is in short loops over few arrays, which the compiler makes run on vectors
(it gives up where more than a few of them might overlap); only those to which something may happen are visited one
by one.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from evimo.events.logarithms import exp, ln
from evimo.scene.rays.compiling import compiler
from evimo.simulate.kernels import PixelState, is_calm, low_passed, next_event, slope_to

BAND = 8  # rows
STRETCH = 512  # pixels whose state stays in a fast cache from one loop to the next
F4 = NDArray[np.float32]
F8 = NDArray[np.float64]

_1, NONE = np.float32(1), np.int64(0)  # no literal: numba would compile callees for it too
KERNELS = ("bands", "kernels", "../events/logarithms", "../scene/rays/compiling")
_compiled = compiler(Path(__file__).parent, KERNELS)
_jit, _parallel = _compiled(), _compiled(parallel=True)


class EventRoom(NamedTuple):
    """Room for events, one row per band."""

    t: NDArray[np.int64]
    pixel: NDArray[np.int32]
    p: NDArray[np.int8]


class Exposures(NamedTuple):
    """What pixels are fed with at (E,) instants: frames, or what lies between two of them where lamps flicker.

    time_s: of each. before: index of the frame at or before it. share: of the way from there to the next frame.
    lamp:   how much brighter the lamps make it.
    pace:   of the low-pass: times irradiance, the step since the instant before in time constants.
    """

    time_s: F8
    before: NDArray[np.int64]
    share: F4
    lamp: F4
    pace: F4


class Seen(NamedTuple):
    """Irradiance (F, N) of frames, what is added to it, and `Exposures`."""

    image: F4
    floor: np.float32
    time_s: F8
    before: NDArray[np.int64]
    share: F4
    lamp: F4
    pace: F4


class Fed(NamedTuple):
    """What pixels read: times (E,), s; and (E, N) ln of irradiance, lag and decay.

    lag, decay: of the low-pass in the step before each instant: tau / step and exp(-step / tau); empty for infinitely
        fast pixels.
    """

    time_s: F8
    signal: F4
    lag: F4
    decay: F4


class _Stretch(NamedTuple):
    """What is known of some pixels at one instant; before: what they read an instant ago."""

    light: F4
    signal: F4
    before: F4
    lag: F4
    decay: F4
    level: F8
    slope: F8
    gap: F8
    busy: NDArray[np.uint8]


def _expose(source, e, first, row, lagging):
    """What pixels from `first` on read at instant e of frames that are `Seen`."""
    image, floor, number = source.image, source.floor, len(row.signal)
    f, share, lamp, pace = source.before[e], source.share[e], source.lamp[e], source.pace[e]
    now, then = image[f, first : first + number], image[min(f + 1, len(image) - 1), first : first + number]
    light, signal, lag, decay = row.light, row.signal, row.lag, row.decay
    for i in range(number):
        light[i] = (now[i] + (then[i] - now[i]) * share) * lamp + floor
    for i in range(number):
        signal[i] = ln(light[i])
    if lagging:
        for i in range(number):
            lag[i], decay[i] = _1 / (light[i] * pace), exp(-light[i] * pace)


def _take(source, e, first, row, lagging):
    """What pixels from `first` on read at instant e of what is `Fed`."""
    stop = first + len(row.signal)
    row.signal[:] = source.signal[e, first:stop]
    if lagging:
        row.lag[:], row.decay[:] = source.lag[e, first:stop], source.decay[e, first:stop]


def _read(source, e, first, row, lagging):
    """What pixels from `first` on read at instant e; numba compiles the one of both that fits the source."""
    (_take if isinstance(source, Fed) else _expose)(source, e, first, row, lagging)


@overload(_read)
def _reader(source, e, first, row, lagging):
    return _take if source.instance_class is Fed else _expose


@_jit
def _advance(row, interval, pixels, lagging):
    """Bring pixels over an interval as far as nothing happens to them; where something may, `row.busy` is 1."""
    start, stop = interval
    step, number = stop - start, len(row.signal)
    signal, before, lag, decay = row.signal, row.before, row.lag, row.decay
    level, slope, gap, busy = row.level, row.slope, row.gap, row.busy
    old, leak, on, off = pixels.level, pixels.leak, pixels.on, pixels.off
    last, blind, noise = pixels.gap, pixels.blind, pixels.noise
    if lagging:
        for i in range(number):
            level[i] = low_passed(old[i], np.float64(before[i]), np.float64(signal[i]), lag[i], decay[i])
    else:
        for i in range(number):
            level[i] = signal[i]
    for i in range(number):
        slope[i] = slope_to(level[i], old[i], step, leak[i] * on[i])
    for i in range(number):
        gap[i] = last[i] + slope[i] * step
    for i in range(number):
        busy[i] = not is_calm(gap[i], (on[i], off[i]), interval, (blind[i], noise[i]))
    for i in range(number):
        old[i] = level[i]
    for i in range(number):
        before[i] = signal[i]


@_jit
def _visit(row, interval, first, pixels, settings, place):
    """Let the busy pixels fire into the room of events, as far as there is room; returns how many fire."""
    start, stop = interval
    out, band, count = place
    room = out.t.shape[1]
    for i in range(len(row.busy)):
        if row.busy[i]:
            now, sign = start, 1
            while sign != 0:
                now, stamp, sign = next_event(i, (now, stop), row.slope[i], pixels, settings)
                if sign != 0 and count < room:
                    out.t[band, count], out.pixel[band, count], out.p[band, count] = stamp, first + i, sign
                count += abs(sign)
            row.gap[i] = pixels.gap[i]
    for i in range(len(row.gap)):
        pixels.gap[i] = row.gap[i]
    return count


@_jit
def _part(pixels, first, stop):
    """The state of some pixels, as views."""
    on, off, leak = pixels.on[first:stop], pixels.off[first:stop], pixels.leak[first:stop]
    level, gap, blind = pixels.level[first:stop], pixels.gap[first:stop], pixels.blind[first:stop]
    shot, noise, fading = pixels.shot[first:stop], pixels.noise[first:stop], pixels.fading[first:stop]
    return PixelState(on, off, leak, shot, level, gap, blind, noise, pixels.random[first:stop], fading)


@_jit
def _narrowed(work, before, n):
    """The first n pixels of a stretch, as views, with what they read before."""
    light, signal, lag, decay = work.light[:n], work.signal[:n], work.lag[:n], work.decay[:n]
    return _Stretch(light, signal, before, lag, decay, work.level[:n], work.slope[:n], work.gap[:n], work.busy[:n])


@_jit
def _empty(kind: Any) -> Any:
    return np.empty(STRETCH, kind)  # rows of one array would not count as contiguous


@_jit
def _workspace():
    f, d = np.float32, np.float64
    levels = _empty(d), _empty(d), _empty(d)
    return _Stretch(_empty(f), _empty(f), _empty(f), _empty(f), _empty(f), *levels, _empty(np.uint8))


@_jit
def _band(source, number, pixels, settings, out):
    """All instants of one band of pixels; returns the number of events."""
    per_band, total = BAND * settings.width, len(pixels.level)
    first, stop = number * per_band, min(total, (number + 1) * per_band)
    before, work, time_s, count = np.empty(stop - first, np.float32), _workspace(), source.time_s, NONE
    for e in range(len(time_s)):
        for begin in range(first, stop, STRETCH):
            end = min(stop, begin + STRETCH)
            row = _narrowed(work, before[begin - first : end - first], end - begin)
            _read(source, e, begin, row, settings.lagging)
            if e == 0:
                row.before[:] = row.signal
                continue
            interval, part = (time_s[e - 1], time_s[e]), _part(pixels, begin, end)
            _advance(row, interval, part, settings.lagging)
            count = _visit(row, interval, begin, part, settings, (out, number, count))
    return count


@_parallel
def events_of(source, pixels, settings, out):
    """Events from the first instant to the last; continues from, and updates, the state in `pixels`.

    Returns:
        Number of events of each band; what exceeds the room was not written.

    Args:
        source: `Seen` or `Fed`. pixels: `PixelState`. settings: `KernelSettings`. out: `EventRoom`.
    """
    filled = np.zeros(len(out.t), np.int64)
    for number in numba.prange(len(filled)):
        filled[number] = _band(source, np.int64(number), pixels, settings, out)
    return filled
