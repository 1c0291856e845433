"""Outlines are found where they are, though events lie beside them: pixels of a plain event camera are worked out.

A pixel that a blurred step in light passes fires each time ln(light) has changed by the contrast threshold.
"""

import numpy as np
import pytest
from scipy.stats import norm

from evimo.calibrating.outline_fit import Round, fit_outlines
from evimo.calibrating.profiles import EVERY_PX, REACH_PX, STEPS, Profiles

CONTRAST, BLUR_PX = 0.3, 0.7
AT = np.arange(-REACH_PX, REACH_PX + EVERY_PX / 2, EVERY_PX)


def fired(outwards, near_over_far):
    """Where a pixel lies from the outline, px, each time it fires; `near_over_far` is ln of the ratio of light."""
    near, far = np.exp(near_over_far), 1.0
    first, last = (far, near) if outwards else (near, far)
    count = int(abs(np.log(last / first)) / CONTRAST)
    levels = first * np.exp(np.sign(np.log(last / first)) * CONTRAST * np.arange(1, count + 1))
    return BLUR_PX * norm.ppf((levels - near) / (far - near))


def filmed(rng, truth, count=4_000, texture=0.3):
    """Profiles of outlines whose calibration is off by `truth`, in steps; texture lies on the near side."""
    speed = rng.uniform(10, 150, count) * rng.choice((-1, 1), count)
    slopes = np.concatenate((rng.normal(0, 0.15, (count, 6)), -1e-6 * STEPS[6] * speed[:, None]), axis=1)
    slopes[:, :3] *= 0.3
    there = slopes @ truth
    step = rng.uniform(0.5, 1.6, count) * rng.choice((-1, 1), count)
    events = np.zeros((count, 2, len(AT)))
    for number in range(count):
        on = int((speed[number] > 0) == (step[number] > 0))
        for px in fired(speed[number] > 0, step[number]):
            events[number, on] += norm.pdf(AT, there[number] + px, 0.6)
    events += texture * rng.poisson(0.3, events.shape) * (there[:, None] - 1 > AT)[:, None]
    return Profiles(AT, events, slopes, speed, rng.integers(0, 2, count), np.arange(count) % 60)


TRUTH = np.array((1.0, -2.0, 0.5, 3.0, -4.0, 2.0, 1.0))


def test_events_beside_outlines_spoil_neither_place_nor_clock():
    found = filmed(np.random.default_rng(1), TRUTH)
    how = Round(1.0, 1.0, place=True, shifts=True)
    step, shifts = fit_outlines(found, how, np.zeros(7))
    off = np.abs(step / STEPS - TRUTH)
    assert off[:3].max() < 0.5 and off[3:6].max() < 0.2  # mm, mrad
    assert off[6] * STEPS[6] < 300  # us
    assert 0.05 < shifts.behind < 0.6 and 0.05 < shifts.dark < 0.6  # both as the pixels say, below their blur
    assert abs(shifts.room) < 0.15 and abs(shifts.body) < 0.15
    assert abs(shifts.on_lag_us) < 500


def test_without_shifts_the_clock_is_late():
    found = filmed(np.random.default_rng(1), TRUTH)
    step, _ = fit_outlines(found, Round(1.0, 1.0, place=True, shifts=False), np.zeros(7))
    assert step[6] - STEPS[6] * TRUTH[6] > 800


def test_a_place_that_is_held_stays():
    found = filmed(np.random.default_rng(2), TRUTH, count=1_000)
    step, _ = fit_outlines(found, Round(1.0, 1.0, place=False, shifts=True), np.array((0.01, 0, 0, 0, 0, 0, 0)))
    assert np.abs(step[:3]).max() < 1e-5


def test_a_place_is_drawn_to_where_it_was():
    nothing = filmed(np.random.default_rng(3), TRUTH, count=10)
    nothing = nothing.where(np.zeros(10, np.bool_))
    apart = np.array((0.01, 0, 0, 0, 0.02, 0, 500.0))
    step, _ = fit_outlines(nothing, Round(1.0, 1.0, place=True, shifts=True), apart)
    assert step == pytest.approx(-apart, rel=1e-3, abs=1e-6)
