import dataclasses

import numpy as np
import pytest

from evimo.simulate.sensor import SensorSettings, draw_sensor


def drawn(name, *, dark=False):
    return np.array([getattr(draw_sensor(np.random.default_rng(seed), dark=dark), name) for seed in range(300)])


def test_thresholds_reach_what_others_found_to_transfer():
    contrast = drawn("contrast")
    assert contrast.min() >= 0.15
    assert contrast.max() <= 1
    assert 0.05 < (contrast > 0.6).mean() < 0.15


def test_normal_light_is_quiet_and_the_dark_is_not():
    assert np.median(drawn("shot_hz")) < 0.1
    assert np.median(drawn("shot_hz", dark=True)) > 1
    assert drawn("bandwidth_hz", dark=True).max() <= drawn("bandwidth_hz").min()
    assert (drawn("flicker_depth", dark=True) > 0).mean() == pytest.approx(0.5, abs=0.1)
    assert (drawn("flicker_depth") > 0).mean() < 0.15


def test_the_same_generator_draws_the_same_sensor():
    one, two = (draw_sensor(np.random.default_rng(5)) for _ in range(2))
    assert one == two
    assert dataclasses.asdict(SensorSettings())["contrast"] == 0.3
