"""An array of event pixels: feed it frames, it gives events."""

import math
from copy import deepcopy

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.events.events import Events
from evimo.simulate.bands import BAND, EventRoom, Exposures, Fed, Seen, events_of
from evimo.simulate.kernels import NEVER, KernelSettings, PixelState, seeded
from evimo.simulate.sensor import WHITE, SensorSettings

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
EVENTS_PER_PIXEL = 8  # room between two calls, on average over a band, until more is needed
FLICKER_STEP_S = 0.0005
CLOUDS = (4, 5)  # uneven places down and across the sensor
NEVER_US = 1 << 62
COLDEST_HZ = 10  # of hot pixels


class Pixels:
    """The pixels of one sensor, started on a first frame.

    Args:
        settings: of the sensor. size: height and width. rng: draws the mismatch between pixels.
        first: irradiance (H, W) at `start_s`, when the sensor has long been looking at it.
    """

    def __init__(self, settings: SensorSettings, rng: np.random.Generator, *, first: F4, start_s: float) -> None:
        self.settings, self.size = settings, first.shape
        number = first.size
        self.kernel = KernelSettings(
            first.shape[1], settings.refractory_s, settings.jitter_s, settings.bandwidth_hz > 0
        )
        self.state = _state(settings, rng, self.size)
        _heat(self.state, settings, rng)
        light = first * self._lamp(np.array([start_s]))
        self.state.level[:] = np.log(light + np.float32(settings.floor)).ravel()
        # as of levels that have wandered between the thresholds for long
        self.state.gap[:] = 0.999 * rng.triangular(-self.state.off, 0, self.state.on)
        with np.errstate(divide="ignore"):
            wait = -np.log(rng.random(number)) / self.state.shot
        self.state.noise[:] = np.where(self.state.shot > 0, start_s + wait, NEVER)
        self.room = self.room_for(EVENTS_PER_PIXEL * BAND * first.shape[1])
        self.before = deepcopy(self.state)  # to start a call again with more room

    def room_for(self, each: int) -> EventRoom:
        """Empty, for so many events of each band."""
        shape = (math.ceil(self.size[0] / BAND), each)
        return EventRoom(np.empty(shape, np.int64), np.empty(shape, np.int32), np.empty(shape, np.int8))

    def events(self, image: F4, time_s: F8) -> Events:
        """Events from the first to the last of the frames (F, H, W), irradiance at times (F,); sorted by time.

        The first frame is the last one of the call before (or the one the sensor was started on). Jitter can move
        single events beyond these times.
        """
        frames, floor = image.reshape(len(image), -1), np.float32(self.settings.floor)
        return self.events_of(Seen(frames, floor, *self.exposures(time_s)))

    def events_of(self, source: Seen | Fed) -> Events:
        """As `events`, of what the pixels see, or of what they read."""
        for kept, value in zip(self.before, self.state, strict=True):
            kept[:] = value
        fired = events_of(source, self.state, self.kernel, self.room)
        if fired.max() > self.room.t.shape[1]:  # once more, with room for all
            self.room = self.room_for(int(1.5 * fired.max()))
            self.state, self.before = self.before, self.state
            fired = events_of(source, self.state, self.kernel, self.room)
        return self._gathered(fired)

    def _gathered(self, fired: NDArray[np.int64]) -> Events:
        t, pixel, p = (np.concatenate([row[:n] for row, n in zip(rows, fired, strict=True)]) for rows in self.room)
        since = t - t.min(initial=NEVER_US)
        few_bits = np.min_scalar_type(since.max(initial=0))  # 16 are sorted digit by digit, ten times as fast
        order = np.argsort(since.astype(few_bits), kind="stable")
        y, x = np.divmod(pixel[order], self.size[1])
        return Events(x.astype(np.uint16), y.astype(np.uint16), t[order], p[order])

    def exposures(self, time_s: F8) -> Exposures:
        """The instants that frames at times (F,) make: steps short enough for the lamps, where they flicker."""
        parts = 1
        if self.settings.flicker_depth:
            parts = max(1, math.ceil(np.diff(time_s).max() / FLICKER_STEP_S))
        at = np.arange((len(time_s) - 1) * parts + 1) / parts
        before = at.astype(np.int64)
        finer = np.interp(at, np.arange(len(time_s)), time_s)
        steps = np.diff(finer, prepend=finer[0] - 1).astype(np.float32)
        slowest = 2 * np.pi * self.settings.bandwidth_hz / (WHITE + self.settings.floor)
        return Exposures(
            finer, before, (at - before).astype(np.float32), self._lamp(finer), steps * np.float32(slowest)
        )

    def _lamp(self, time_s: F8) -> F4:
        """How bright lamps on alternating current are: twice per period; 1 where they are steady."""
        wave = np.abs(np.sin(np.pi * self.settings.flicker_hz * time_s))
        return (1 + self.settings.flicker_depth * wave).astype(np.float32)


def blurred(image: F4, sigma_px: float) -> F4:
    """Frames (F, H, W) through the lens's point spread."""
    if not sigma_px:
        return image
    return np.stack([cv2.GaussianBlur(frame, (0, 0), sigma_px, borderType=cv2.BORDER_REPLICATE) for frame in image])


def _state(settings: SensorSettings, rng: np.random.Generator, size: tuple[int, int]) -> PixelState:
    number, ratio = size[0] * size[1], math.sqrt(settings.on_over_off)
    on, off = (
        np.maximum(0.02, settings.contrast * side * (1 + settings.mismatch * rng.normal(size=number)))
        for side in (ratio, 1 / ratio)
    )
    leak, shot = (rate * _uneven(settings, rng, size) for rate in (settings.leak_hz, settings.shot_hz))
    level, gap, blind, noise = (np.zeros(number) for _ in range(4))
    blind -= NEVER
    random = seeded(int(rng.integers(2**62)), number)
    return PixelState(on, off, leak, shot, level, gap, blind, noise, random, np.full(number, 1 / settings.shot_light))


def _uneven(settings: SensorSettings, rng: np.random.Generator, size: tuple[int, int]) -> F8:
    """How many times the sensor's rate each pixel (N,) has: log-normal in large patches, with a heavier tail each."""
    clouds = cv2.resize(rng.normal(size=CLOUDS), size[::-1], interpolation=cv2.INTER_CUBIC).ravel()
    return np.exp(settings.patches * clouds + rng.laplace(scale=settings.spread, size=clouds.size))


def _heat(state: PixelState, settings: SensorSettings, rng: np.random.Generator) -> None:
    """Make some pixels hot, whatever the light: half of them fire at random, half steadily in one polarity."""
    hot = np.flatnonzero(rng.random(len(state.shot)) < settings.hot_share)
    rate = np.exp(rng.uniform(math.log(COLDEST_HZ), math.log(settings.hot_hz), len(hot)))
    steady, falling = rng.random((2, len(hot))) < 0.5
    state.shot[hot], state.fading[hot] = np.where(steady, 0, rate), 0.0
    sign = np.where(falling, -state.off[hot] / state.on[hot], 1)  # leakage is in ON thresholds per second
    state.leak[hot] = np.where(steady, sign * rate, state.leak[hot])
