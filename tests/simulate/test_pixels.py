"""The event pixel against formulas and brute force: counts, times, noise."""

import numpy as np
import pytest
from scipy.special import erf, erfinv

from evimo.simulate.pixels import Pixels, blurred
from evimo.simulate.sensor import SensorSettings

CLEAN = {
    "mismatch": 0.0,
    "refractory_s": 0.0,
    "bandwidth_hz": 0.0,
    "floor": 0.0,
    "shot_hz": 0.0,
    "shot_light": np.inf,
    "leak_hz": 0.0,
    "patches": 0.0,
    "spread": 0.0,
    "jitter_s": 0.0,
    "blur_px": 0.0,
}


def started(first, start_s=0.0, **settings):
    """Pixels whose memorised level is the first frame's."""
    pixels = Pixels(
        SensorSettings(**{**CLEAN, **settings}), np.random.default_rng(1), first=np.float32(first), start_s=start_s
    )
    pixels.state.gap[:] = 0
    return pixels


def filmed(log_signal, time_s, **settings):
    """Events of a log signal (F, N), one row of pixels."""
    image = np.exp(np.asarray(log_signal, np.float64)).astype(np.float32)[:, None]
    return started(image[0], time_s[0], **settings).events(image, np.asarray(time_s, np.float64))


def test_a_ramp_gives_an_event_per_threshold_at_equal_times():
    slope = np.random.default_rng(0).uniform(-80, 80, 500)
    time = np.linspace(0, 0.1, 11)
    events = filmed(slope * time[:, None], time, contrast=0.25)
    level = np.abs(slope) * 0.1 / 0.25
    sure = np.abs(level - np.round(level)) > 1e-4
    counts = np.bincount(events.x, minlength=500)
    np.testing.assert_array_equal(counts[sure], np.floor(level[sure]))
    assert (events.p == np.sign(slope)[events.x]).all()
    for x in np.flatnonzero(counts):
        crossed = np.arange(1, counts[x] + 1) * 0.25 / abs(slope[x])
        np.testing.assert_allclose(events.t[events.x == x] * 1e-6, crossed, atol=1.5e-6)


def test_random_signals_agree_with_brute_force():
    rng = np.random.default_rng(1)
    time = np.r_[0, np.sort(rng.uniform(0, 0.1, 39))]
    signal = np.cumsum(rng.normal(size=(40, 60)) * 0.25, axis=0)
    events = filmed(signal, time, contrast=0.2)
    fine = np.linspace(0, time[-1], 50_001)
    for pixel in range(30):
        values, level, expected = np.interp(fine, time, signal[:, pixel]), signal[0, pixel], []
        for t, value in zip(fine, values, strict=True):
            if abs(value - level) >= 0.2:
                level += 0.2 * np.sign(value - level)
                expected.append(t)
        np.testing.assert_allclose(events.t[events.x == pixel] * 1e-6, expected, atol=3e-6)


@pytest.mark.parametrize("step_px", [0.1, 0.5])
def test_a_moving_edge_fires_when_the_error_function_says(step_px):
    speed, sigma, dark, bright = 300.0, 0.6, 0.1, 0.8
    x = np.arange(30.0)
    time = np.arange(0, 0.12, step_px / speed)
    place = (speed * time[:, None] - 5 - x) / (sigma * np.sqrt(2))
    signal = np.log(dark + (bright - dark) * 0.5 * (1 + erf(place)))
    events = filmed(signal, time, contrast=0.3)
    count = int(np.log(bright / dark) / 0.3)
    level = dark * np.exp(0.3 * np.arange(1, count + 1))
    offset = sigma * np.sqrt(2) * erfinv(2 * (level - dark) / (bright - dark) - 1)
    for pixel in range(5, 22):
        expected = (pixel + 5 + offset) / speed
        np.testing.assert_allclose(events.t[events.x == pixel] * 1e-6, expected, atol=0.12 * step_px / speed + 2e-6)


def test_thresholds_differ_by_polarity():
    time = np.linspace(0, 0.1, 30)
    up = filmed(np.outer(time * 60, [1, -1]), time, contrast=0.3, on_over_off=1.44)
    assert np.bincount(up.x).tolist() == [int(6 / 0.36), int(6 / 0.25)]


def test_a_step_through_the_low_pass_is_exponential():
    bandwidth, contrast = 200.0, 0.2
    time = np.r_[0, 1e-6, np.linspace(2e-6, 0.003, 1000)]
    bright = np.log(0.6)  # the bandwidth holds at irradiance 0.6
    signal = np.full((len(time), 1), bright)
    signal[0] = bright - 1
    events = filmed(signal, time, contrast=contrast, bandwidth_hz=bandwidth)
    expected = -np.log(1 - contrast * np.arange(1, 5)) / (2 * np.pi * bandwidth)
    np.testing.assert_allclose(events.t[:4] * 1e-6, expected, atol=3e-6)


def test_dim_pixels_are_slower():
    time = np.r_[0, 1e-6, np.linspace(2e-6, 0.1, 2000)]
    signal = np.log(np.array([[0.06, 0.6]])) + np.where(time > 0, 0, -1)[:, None]
    events = filmed(signal, time, contrast=0.5, bandwidth_hz=100.0)
    first = [events.t[events.x == pixel][0] for pixel in (0, 1)]
    assert first[0] == pytest.approx(10 * first[1], rel=0.02)


def quiet(number=20_000, seconds=5.0, frames=6, level=1e-9):
    """A dark still image."""
    return np.full((frames, number), np.log(level)), np.linspace(0, seconds, frames)


def test_shot_noise_comes_at_its_rate_in_both_polarities():
    events = filmed(*quiet(), shot_hz=2.0)
    assert len(events) / 20_000 / 5 == pytest.approx(2.0, rel=0.01)
    assert (events.p > 0).mean() == pytest.approx(0.5, abs=0.01)
    wait = np.diff(np.r_[0, events.t[events.x == 7]])
    assert len(wait) > 3


def test_light_thins_shot_noise():
    light = np.array([1e-9, 0.05, 0.1, 0.6])
    events = filmed(np.full((6, 20_000), np.log(np.repeat(light, 5000))), quiet()[1], shot_hz=4.0, shot_light=0.05)
    assert np.bincount(events.x // 5000) / 5000 / 5 == pytest.approx(
        [4, 4 / np.e, 4 / np.e**2, 0.0], rel=0.03, abs=1e-3
    )


def test_noise_follows_the_light():
    """A pixel that gets dark becomes noisy, one that gets light calms down."""
    signal = np.log([[0.6, 1e-3]] * 500 + [[1e-3, 0.6]] * 500)
    image = np.exp(np.repeat(signal, 500, axis=1)).astype(np.float32)[:, None]
    events = started(image[0], contrast=100.0, shot_hz=5.0, shot_light=0.05).events(image, np.linspace(0, 10, 1000))
    noisy = np.histogram2d(events.t * 1e-6, events.x, bins=([0, 5, 10], [0, 500, 1000]))[0] / 500 / 5
    np.testing.assert_allclose(noisy, [[0, 5 * np.exp(-0.02)], [5 * np.exp(-0.02), 0]], atol=0.15)


def test_leakage_gives_on_events_at_its_rate():
    events = filmed(*quiet(seconds=50.0), leak_hz=0.51)
    assert (events.p > 0).all()
    assert len(events) == 20_000 * 25


def test_noise_is_uneven_with_a_tail_and_in_patches():
    pixels = started(np.full((200, 300), 0.5), shot_hz=1.0, spread=0.4)
    noisier = np.array([(pixels.state.shot > times).mean() for times in (1, 2, 8)])
    assert noisier == pytest.approx(0.5 * np.array([1, 2, 8]) ** -2.5, rel=0.1)  # Laplace: a power law
    cloudy = np.log(started(np.full((200, 300), 0.5), leak_hz=1.0, patches=0.5).state.leak.reshape(200, 300))
    assert cloudy.std() == pytest.approx(0.5, rel=0.4)
    assert np.abs(np.diff(cloudy)).max() < 0.05


def test_hot_pixels_are_few_and_fire_up_to_nine_thousand_times_a_second():
    events = filmed(*quiet(), hot_share=0.02)
    counts = np.bincount(events.x, minlength=20_000)
    hot = counts[counts > 0] / 5
    assert len(hot) == pytest.approx(400, rel=0.15)
    assert np.quantile(hot, [0.05, 0.5, 0.95]) == pytest.approx(10 * 900 ** np.array([0.05, 0.5, 0.95]), rel=0.4)
    assert 7000 < hot.max() < 9300
    polarity = np.bincount(events.x, events.p > 0, minlength=20_000)[counts > 50] / counts[counts > 50]
    one_sided = (polarity == 0).mean(), (polarity == 1).mean()
    assert one_sided == pytest.approx((0.25, 0.25), abs=0.07)
    assert np.median(polarity[(polarity > 0) & (polarity < 1)]) == pytest.approx(0.5, abs=0.05)


def test_hot_pixels_are_held_back_by_the_refractory_period():
    events = filmed(*quiet(seconds=1.0), hot_share=0.02, refractory_s=0.001)
    assert 850 < np.bincount(events.x).max() < 1000
    assert np.diff(np.sort(events.t[events.x == np.bincount(events.x).argmax()])).min() >= 999


@pytest.mark.parametrize("refractory_s", [0.0005, 0.0015])
def test_events_of_a_pixel_keep_the_refractory_distance(refractory_s):
    time = np.linspace(0, 0.2, 400)
    signal = 3 * np.sin(2 * np.pi * 20 * time)[:, None] * np.ones(20)
    events = filmed(signal, time, contrast=0.1, refractory_s=refractory_s, shot_hz=50.0)
    gaps = np.concatenate([np.diff(events.t[events.x == pixel]) for pixel in range(20)])
    assert gaps.min() >= refractory_s * 1e6 - 1
    assert gaps.min() < refractory_s * 1e6 + 50


def test_after_the_dead_time_the_reference_is_the_signal_of_then():
    """A ramp of slope a: events every T + C / a, not every C / a."""
    time = np.linspace(0, 0.5, 50)
    events = filmed(40 * time[:, None], time, contrast=0.2, refractory_s=0.003)
    np.testing.assert_allclose(np.diff(events.t), 1e6 * (0.003 + 0.2 / 40), atol=2)


def test_jitter_has_the_asked_spread():
    time = np.linspace(0, 0.1, 11)
    sharp, blurry = (filmed(np.outer(time * 50, np.ones(1000)), time, contrast=0.3, jitter_s=j) for j in (0, 80e-6))
    shift = np.sort(blurry.t.reshape(-1)) - np.sort(sharp.t)
    assert len(sharp) == len(blurry) > 15_000
    first = blurry.t[np.abs(blurry.t - 6000) < 600] - 6000  # the first crossing, at 6 ms
    assert first.std() == pytest.approx(80, rel=0.05)
    assert abs(shift.mean()) < 2


def test_lamps_make_all_pixels_fire_in_every_period():
    """|sin| at 100 Hz has a period of 10 ms; from level 0.148 on, 0.12 fits twice between 0 and ln 1.4."""
    time = 0.0013 + np.linspace(0, 0.2, 41)
    events = filmed(np.full((41, 50), np.log(0.5)), time, contrast=0.12, flicker_depth=0.4, flicker_hz=100.0)
    for sign in (-1, 1):
        counts = np.bincount(events.t[events.p == sign] // 10_000)
        assert (counts[1:20] == 100).all()


def test_mismatch_spreads_thresholds():
    pixels = started(np.full((50, 80), 0.5), contrast=0.3, mismatch=0.1)
    assert pixels.state.on.std() == pytest.approx(0.03, rel=0.1)
    assert pixels.state.on.mean() == pytest.approx(0.3, rel=0.01)


def test_events_are_sorted_and_rows_and_columns_are_not_mixed_up():
    image = np.full((2, 4, 6), 0.1, np.float32)
    image[1, 3, 1] = 1.0
    events = started(image[0], contrast=0.3).events(image, np.array([0, 0.01]))
    assert (events.x == 1).all()
    assert (events.y == 3).all()
    assert len(events) == int(np.log(10) / 0.3)
    assert (np.diff(events.t) > 0).all()


def test_many_events_find_room():
    """270 events of each pixel, several times the room that there is at first."""
    time = np.linspace(0, 1, 3)
    signal = np.outer([0, 1000.0, 0], np.ones(8)) * 0.08 - 40
    events = filmed(signal, time, contrast=0.3)
    assert np.bincount(events.x).tolist() == [2 * int(80 / 0.3)] * 8
    again = started(np.exp(signal[:1])[:, None][0], contrast=0.3, jitter_s=1e-4, shot_hz=3.0)
    roomy = started(np.exp(signal[:1])[:, None][0], contrast=0.3, jitter_s=1e-4, shot_hz=3.0)
    roomy.room = roomy.room_for(100_000)
    image = np.exp(signal).astype(np.float32)[:, None]
    np.testing.assert_array_equal(again.events(image, time).t, roomy.events(image, time).t)


def test_blur_keeps_light_and_spreads_as_a_gaussian():
    image = np.zeros((1, 21, 21), np.float32)
    image[0, 10, 10] = 1
    spread = blurred(image, 0.8)[0]
    assert spread.sum() == pytest.approx(1, abs=1e-5)
    y, x = np.mgrid[:21, :21] - 10
    assert (spread * x**2).sum() == pytest.approx(0.64, rel=0.03)
    assert (spread * y**2).sum() == pytest.approx(0.64, rel=0.03)
    assert blurred(image, 0.0) is image
