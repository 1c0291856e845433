"""A camera whose place, lens and clock are known is found again from a wand, through noise, drops and outliers."""

import numpy as np
import pytest

from evimo.calibrating.fitting import Free
from evimo.calibrating.rigid import angle_between, nudged
from evimo.calibrating.wand import Wand, calibrate_with_wand
from evimo.geometry.camera import Camera

BLANK = Camera(250.0, 250.0, 172.5, 129.5, 260, 346, (0.0, 0.0, 0.0, 0.0))  # the size is right, and nothing else


@pytest.mark.parametrize("intrinsics", [True, False])
def test_what_was_planted_is_found(known, intrinsics):
    rng = np.random.default_rng(3)
    times_us = np.arange(0.5e6, 14.5e6, 40_000) + 137.0
    about = nudged(known.body_from_wand, np.array((0.002, -0.001, 0.001, 0.01, -0.005, 0.004)))  # markers misplaced
    fit, found = calibrate_with_wand(
        known.spots(rng, times_us),
        times_us,
        Wand(lights=known.lights, body_from_lights=about, deviation_m=0.002),
        known.mocap(rng),
        start=BLANK if intrinsics else known.camera,
        free=Free(intrinsics=intrinsics, lens=intrinsics),
        search_us=200_000,
    )
    made = fit.calibration
    assert np.linalg.norm(made.rig_from_cam[:3, 3] - known.rig_from_cam[:3, 3]) < 0.001
    assert np.degrees(angle_between(made.rig_from_cam, known.rig_from_cam)) < 0.05
    assert abs(made.offset_us - known.offset_us) < 200
    assert made.camera.fx == pytest.approx(known.camera.fx, rel=0.003)
    assert np.linalg.norm(made.body_from_target[:3, 3] - known.body_from_wand[:3, 3]) < 0.001

    assert fit.median_px < 0.35 and len(found) > 1000
