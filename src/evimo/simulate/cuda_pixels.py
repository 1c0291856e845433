# pyright: basic
"""The event pixels on an NVIDIA GPU: a thread for each goes through all instants; where its events go is a sink's.

The pixel is the CPU's (`kernels.next_event`) with the same random numbers, so from the same signal it fires the same
events. Their list takes two runs, the first of which counts: then every pixel has room of its own, and nothing needs to
be atomic.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from evimo.events.events import Events
from evimo.scene.rays.on_device import THREADS, blocks, cuda, on_device, uploaded
from evimo.simulate import kernels
from evimo.simulate.bands import BAND, Exposures, Fed
from evimo.simulate.kernels import PixelState
from evimo.simulate.pixels import Pixels

f32, f64 = np.float32, np.float64
_1 = f32(1)

_low_passed, _begin_step = on_device(kernels.low_passed), on_device(kernels.begin_step)
_next_event = on_device(kernels.next_event)


class EventRows(NamedTuple):
    """A list of events with room for all, those of a pixel in a row.

    next: (N,) where each pixel writes. t: µs. step: of the instants, in which it came. p: polarity.
    """

    next: Any
    t: Any
    step: Any
    p: Any


@cuda.jit
def _expose(image, at, floor, lagging, fed):
    """Irradiance (F, N) of frames to what pixels read."""
    i, e = cuda.grid(2)
    if i < image.shape[1] and e < len(at.time_s):
        f = at.before[e]
        before, after = image[f, i], image[min(f + 1, image.shape[0] - 1), i]
        light = (before + (after - before) * at.share[e]) * at.lamp[e] + floor
        fed.signal[e, i] = math.log(light)
        if lagging:
            pace = light * at.pace[e]
            fed.lag[e, i], fed.decay[e, i] = _1 / pace, math.exp(-pace)


def _run(keep):
    """A kernel that takes pixels through all instants and hands every event to `keep(sink, i, step, stamp, sign)`."""

    @cuda.jit
    def kernel(fed, pixels, settings, sink):
        i = cuda.grid(1)
        if i < fed.signal.shape[1]:
            for e in range(1, len(fed.time_s)):
                start, stop, level = fed.time_s[e - 1], fed.time_s[e], f64(fed.signal[e, i])
                if settings.lagging:
                    before, old = f64(fed.signal[e - 1, i]), pixels.level[i]
                    level = _low_passed(old, before, level, fed.lag[e, i], fed.decay[e, i])
                slope, calm = _begin_step(i, (start, stop), level, pixels)
                if not calm:
                    now, stamp, sign = _next_event(i, (start, stop), slope, pixels, settings)
                    while sign != 0:
                        keep(sink, i, e, stamp, sign)
                        now, stamp, sign = _next_event(i, (now, stop), slope, pixels, settings)

    return kernel


@cuda.jit(device=True)
def _count(number, i, step, stamp, sign):
    number[i] += 1


@cuda.jit(device=True)
def _write(rows, i, step, stamp, sign):
    place = rows.next[i]
    rows.t[place], rows.step[place], rows.p[place] = stamp, step, sign
    rows.next[i] = place + 1


_count_events, _write_events = _run(_count), _run(_write)


class CudaPixels:
    """The pixels of one sensor on the GPU, going on from where `pixels` stand."""

    def __init__(self, pixels: Pixels) -> None:
        self.pixels, self.number = pixels, pixels.size[0] * pixels.size[1]
        self.state = uploaded(pixels.state)

    def fed(self, image: Any, at: Exposures) -> Fed:
        """What the pixels read in frames (F, H, W) on the GPU, which `at` names."""
        settings = self.pixels.kernel
        shape = (len(at.time_s), self.number)
        late = shape if settings.lagging else (1, 1)
        fed: Any = Fed(
            cuda.to_device(at.time_s), *(cuda.device_array(each, np.float32) for each in (shape, late, late))
        )
        grid = ((blocks(self.number), shape[0]), (THREADS, 1))
        flat = image.reshape(image.shape[0], self.number)
        _expose[grid](flat, uploaded(at), f32(self.pixels.settings.floor), settings.lagging, fed)
        return fed

    def events(self, fed: Fed) -> Events:
        """All events, in the order of `Pixels.events`."""
        grid, settings = (blocks(self.number), THREADS), self.pixels.kernel
        number = cuda.to_device(np.zeros(self.number, np.int64))
        _count_events[grid](fed, _copied(self.state), settings, number)
        number = number.copy_to_host()
        first = np.cumsum(number) - number
        kinds = (np.int64, np.int32, np.int8)
        room = (cuda.device_array(max(1, int(number.sum())), kind) for kind in kinds)
        rows = EventRows(cuda.to_device(first), *room)
        _write_events[grid](fed, self.state, settings, rows)
        return self._ordered(number, rows)

    def _ordered(self, number: np.ndarray, rows: EventRows) -> Events:
        """By time, and where times are equal as the CPU comes upon them: by band of pixels, instant and pixel."""
        t, step, p = (column.copy_to_host()[: int(number.sum())] for column in rows[1:])
        pixel = np.repeat(np.arange(self.number), number)
        width = self.pixels.size[1]
        met = pixel // (BAND * width) * (int(step.max(initial=0)) + 1) + step
        order = np.lexsort((met, t))
        y, x = np.divmod(pixel[order], width)
        return Events(x.astype(np.uint16), y.astype(np.uint16), t[order], p[order])


def _copied(state: Any) -> Any:
    copies: Any = PixelState(*(cuda.device_array_like(values) for values in state))
    for copy, values in zip(copies, state, strict=True):
        copy.copy_to_device(values)
    return copies
