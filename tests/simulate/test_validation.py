"""The event pixel from first principles: tests 1 to 5 of the simulator's list; 6 and 7 are in test_validation_truth.py,
8 in tests/scene/rays/test_torch_twin.py.

An ideal pixel knows no unit of time: slowed down a million times, its events come a million times later. Filmed so,
whole microseconds of a time stamp are picoseconds.
"""

import numpy as np
import pytest
from scipy.special import erf, erfinv

from evimo.events.events import Events
from evimo.simulate.bands import Fed
from evimo.simulate.pixels import Pixels
from evimo.simulate.sensor import WHITE, SensorSettings

SLOWED = 1e6
NANOSECOND = 1e-9
CLEAN = {
    "mismatch": 0.0,
    "refractory_s": 0.0,
    "bandwidth_hz": 0.0,
    "floor": 0.0,
    "shot_hz": 0.0,
    "leak_hz": 0.0,
    "patches": 0.0,
    "spread": 0.0,
    "jitter_s": 0.0,
    "blur_px": 0.0,
}


def started(first, **settings):
    """One row of pixels (N,) that has memorised the irradiance it sees at first."""
    how = SensorSettings(**{**CLEAN, **settings})
    pixels = Pixels(how, np.random.default_rng(1), first=np.float32(first)[None], start_s=0.0)
    pixels.state.gap[:] = 0
    return pixels


def filmed(irradiance, time_s, **settings):
    """Events of irradiance (F, N)."""
    return started(irradiance[0], **settings).events(np.float32(irradiance)[:, None], time_s)


def filmed_in_slow_motion(signal, time_s, *, contrast):
    """Events of the log signal (F, N) float32 itself, which no logarithm has rounded; seconds of the original."""
    pixels = started(np.exp(signal[0]), contrast=contrast)
    pixels.state.level[:] = signal[0]
    none = np.empty((0, 0), np.float32)
    events = pixels.events_of(Fed(time_s * SLOWED, signal, none, none))
    return events, events.t * 1e-6 / SLOWED


def of_pixel(events: Events, x: int):
    return events.x == x


def test_1_log_ramp_fires_floor_of_at_over_c_times_at_equal_distances():
    """Every count, and every time to 0.004 µs."""
    frames, contrast = np.arange(11), 0.25
    climb = np.random.default_rng(0).integers(-209_715, 209_715, 500) * 2.0**-18  # per frame: exact in float32
    signal = (frames[:, None] * climb).astype(np.float32)
    assert (signal == frames[:, None] * climb).all()
    events, time_s = filmed_in_slow_motion(signal, frames * 0.01, contrast=contrast)
    slope = climb / 0.01
    counts = np.bincount(events.x, minlength=500)
    np.testing.assert_array_equal(counts, np.floor(np.abs(slope) * 0.1 / contrast))
    assert counts.sum() > 5000
    assert (events.p == np.sign(slope)[events.x]).all()
    for x in np.flatnonzero(counts):
        expected = np.arange(1, counts[x] + 1) * contrast / abs(slope[x])
        np.testing.assert_allclose(time_s[of_pixel(events, x)], expected, rtol=0, atol=4 * NANOSECOND)


def brute_force(time_s, signal, contrast, *, steps):
    """Times and polarities of one pixel's events, found by looking at `steps` instants one after the other."""
    fine = np.linspace(0, time_s[-1], steps)
    values, level, at, found = np.interp(fine, time_s, signal), signal[0], 0, []
    while (far := np.abs(values[at:] - level) >= contrast).any():
        at += int(far.argmax())
        sign = 1 if values[at] > level else -1
        level += sign * contrast
        found.append((fine[at], sign))
    return np.array(found).reshape(-1, 2).T


def test_2_random_piecewise_signals_agree_with_brute_force_on_200_000_instants():
    rng = np.random.default_rng(0)
    time_s = np.r_[0, np.sort(rng.uniform(0, 0.1, 39))]
    signal = np.cumsum(rng.normal(size=(40, 40)) * 0.25, axis=0).astype(np.float32)
    events, seconds = filmed_in_slow_motion(signal, time_s, contrast=0.2)
    for pixel in range(40):
        mine = of_pixel(events, pixel)
        expected, signs = brute_force(time_s, signal[:, pixel].astype(float), 0.2, steps=200_001)
        assert len(expected) > 5
        np.testing.assert_array_equal(events.p[mine], signs)  # none more, none fewer
        np.testing.assert_allclose(seconds[mine], expected, rtol=0, atol=time_s[-1] / 200_000)


@pytest.mark.parametrize(
    ("step_px", "median_ms", "most_px"), [(0.1, 0.0025, 0.01), (0.5, 0.035, 0.05), (1.0, 0.037, 0.205)]
)
def test_3_moving_edge_through_a_gaussian_fires_when_the_inverse_error_function_says(step_px, median_ms, most_px):
    speed, sigma, dark, bright = 300.0, 0.6, 0.1, 0.8
    x, time_s = np.arange(40.0), np.arange(0, 0.15, step_px / speed)
    place = (speed * time_s[:, None] - 5 - x) / (sigma * np.sqrt(2))
    events = filmed(dark + (bright - dark) * 0.5 * (1 + erf(place)), time_s, contrast=0.3)
    levels = dark * np.exp(0.3 * np.arange(1, int(np.log(bright / dark) / 0.3) + 1))
    offset = sigma * np.sqrt(2) * erfinv(2 * (levels - dark) / (bright - dark) - 1)
    errors = []
    for pixel in range(5, 25):
        fired = events.t[of_pixel(events, pixel)] * 1e-6
        assert len(fired) == len(levels) == 6
        errors.append(fired - (pixel + 5 + offset) / speed)
    assert np.median(np.abs(errors)) < median_ms * 1e-3
    assert np.abs(errors).max() * speed < most_px


def test_4_step_through_the_low_pass_fires_at_minus_tau_ln_1_minus_kc():
    """To 1e-4 ms; the step is a ramp of 1 µs, which comes on average half of that later."""
    bandwidth, contrast, rise = 200.0, 0.2, 1e-6
    time_s = np.r_[0, rise, np.linspace(rise, 0.02, 2001)[1:]]
    irradiance = np.full((len(time_s), 3), WHITE)  # where the bandwidth holds
    irradiance[0] /= np.e
    events = filmed(irradiance, time_s * SLOWED, contrast=contrast, bandwidth_hz=bandwidth / SLOWED)
    expected = -np.log(1 - contrast * np.arange(1, 5)) / (2 * np.pi * bandwidth) + rise / 2
    for pixel in range(3):
        fired = events.t[of_pixel(events, pixel)] * 1e-6 / SLOWED
        np.testing.assert_allclose(fired[:4], expected, rtol=0, atol=1e-7)
        assert len(fired) <= 5  # the fifth is the limit, reached at infinity


STILL = np.full((21, 20_000), 1e-9), np.linspace(0, 10, 21)
"""A dark picture that stands still for 10 s."""


def test_5_shot_noise_has_its_rate_and_both_polarities():
    """A million events: their number is right to 0.1 %."""
    events = filmed(*STILL, shot_hz=5.0)
    assert len(events) / 20_000 / 10 == pytest.approx(5, rel=0.003)
    assert (events.p > 0).mean() == pytest.approx(0.5, abs=0.002)


def test_5_leakage_has_its_rate_and_is_on():
    """At 0.55 Hz, 5 events in 10 s and half a one that is still to come; slower and faster pixels likewise."""
    for spread in (0.0, 0.3):
        pixels = started(STILL[0][0], leak_hz=0.55, spread=spread)
        expected = np.floor(pixels.state.leak * 10)
        assert (np.ptp(expected) == 0) == (spread == 0)
        assert np.median(expected) == 5
        events = pixels.events(np.float32(STILL[0])[:, None], STILL[1])
        wrong = np.bincount(events.x, minlength=20_000) != expected
        assert wrong.mean() < 1e-3  # where the last one is due at the very end
        assert (events.p > 0).all()


@pytest.mark.parametrize("refractory_s", [0.0005, 0.0015])
def test_5_no_interval_is_shorter_than_the_refractory_period(refractory_s):
    time_s = np.linspace(0, 0.2, 400)
    signal = 3 * np.sin(2 * np.pi * 20 * time_s)[:, None] * np.ones(50)
    events = filmed(np.exp(signal), time_s, contrast=0.1, refractory_s=refractory_s, shot_hz=20.0, shot_light=1e9)
    gaps = np.concatenate([np.diff(events.t[of_pixel(events, x)]) for x in range(50)])
    assert refractory_s * 1e6 - 1 <= gaps.min() < refractory_s * 1e6 + 60
