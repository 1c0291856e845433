"""Bands of event pixels: however a film is cut, fed or shared out among threads, it fires the same events."""

from dataclasses import replace

import numba
import numpy as np
import pytest

from evimo.events.events import joined
from evimo.simulate.bands import Fed
from evimo.simulate.pixels import Pixels
from evimo.simulate.sensor import SensorSettings

NOISY = SensorSettings(
    mismatch=0.1,
    refractory_s=0.001,
    bandwidth_hz=300.0,
    floor=0.003,
    shot_hz=20.0,
    shot_light=np.inf,
    leak_hz=1.0,
    patches=0.0,
    spread=0.0,
    jitter_s=0.0,
    blur_px=0.0,
)


def started(first, **settings):
    """Noisy pixels whose memorised level is the first frame's."""
    pixels = Pixels(replace(NOISY, **settings), np.random.default_rng(1), first=first, start_s=0.0)
    pixels.state.gap[:] = 0
    return pixels


def textured_film(frames=13):
    rng = np.random.default_rng(5)
    return np.exp(rng.normal(size=(frames, 20, 30)).cumsum(axis=0) * 0.3 - 1).astype(np.float32)


def test_one_film_in_two_parts_gives_the_same_events():
    image, time = textured_film(), np.linspace(0, 0.06, 13)
    whole = started(image[0]).events(image, time)
    pixels = started(image[0])
    parts = joined([pixels.events(image[:6], time[:6]), pixels.events(image[5:], time[5:])])
    assert len(whole) > 1000
    for name in ("x", "y", "t", "p"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name))


@pytest.mark.parametrize("flicker", [0.0, 0.3])
def test_a_film_fires_what_its_logarithms_and_time_constants_do(flicker):
    """27 rows of 90: bands and the stretches within them end in the midst of things."""
    rng, time = np.random.default_rng(6), np.linspace(0, 0.011, 13)
    image = np.exp(rng.normal(size=(13, 27, 90)).cumsum(axis=0) * 0.3 - 1).astype(np.float32)
    pixels, again = (started(image[0], flicker_depth=flicker) for _ in range(2))
    at = pixels.exposures(time)
    passed = np.interp(at.time_s, time, np.arange(13))[:, None, None]
    first = np.minimum(passed.astype(int), 11).ravel()
    light = (image[first] + (passed - first[:, None, None]) * (image[first + 1] - image[first])).reshape(len(first), -1)
    light = light * (1 + flicker * np.abs(np.sin(np.pi * 100 * at.time_s)))[:, None] + 0.003
    steps = np.diff(at.time_s, prepend=-1)[:, None] * light / 0.603 * 2 * np.pi * 300
    fed = Fed(at.time_s, *(values.astype(np.float32) for values in (np.log(light), 1 / steps, np.exp(-steps))))
    film, expected = pixels.events(image, time), again.events_of(fed)
    assert len(at.time_s) == (25 if flicker else 13)
    assert len(film) == len(expected) > 1000
    same = (film.x == expected.x) & (film.y == expected.y) & (film.p == expected.p)
    assert same.mean() > 0.99
    assert np.abs(film.t - expected.t).max() <= 1


def test_the_number_of_threads_changes_nothing():
    image, time = textured_film(), np.linspace(0, 0.06, 13)
    threads = numba.get_num_threads()
    try:
        several = started(image[0]).events(image, time)
        numba.set_num_threads(1)
        one = started(image[0]).events(image, time)
    finally:
        numba.set_num_threads(threads)
    np.testing.assert_array_equal(one.t, several.t)
    np.testing.assert_array_equal(one.x, several.x)
