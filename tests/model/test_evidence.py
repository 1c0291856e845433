from math import pi

import numpy as np
import pytest
import torch

from evimo.model.evidence import CANDIDATES, TRUSTS, evidence

SMALL, LARGE, SLOW, REFINED, REFINED_COARSE = range(CANDIDATES)


def log_counts(shift, *, reduction, noise=0.0):
    """Log counts (1, 5, 2, H, W) of a random pattern that moves by (dx, dy) px per slice."""
    rng = np.random.default_rng(1)
    angle, phase = rng.uniform(0, 2 * pi, (2, 2, 40, 1, 1))
    per_px = 2 * pi / rng.uniform(14, 40, (2, 40, 1, 1))
    y, x = np.mgrid[: 20 * reduction, : 24 * reduction]
    slices = []
    for n in range(-2, 3):
        along = np.cos(angle) * (x - n * shift[0]) + np.sin(angle) * (y - n * shift[1])
        pattern = 1.5 + np.cos(per_px * along + phase).sum(1) / 8
        slices.append(np.maximum(0, pattern + noise * rng.normal(size=pattern.shape)))
    return torch.tensor(np.stack(slices))[None].float()


def errors(shift, **how):
    """Mean length of each candidate's error, px, away from the border."""
    found = evidence(log_counts(shift, **how), how["reduction"]).motion[0, :, :, 4:-4, 4:-4]
    return (found - torch.tensor(shift).view(2, 1, 1)).norm(dim=1).mean((1, 2)).tolist()


@pytest.mark.parametrize("reduction", [3, 4])
def test_shapes(reduction):
    found = evidence(log_counts((0.0, 0.0), reduction=reduction), reduction)
    assert found.motion.shape == (1, CANDIDATES, 2, 20, 24)
    assert found.trust.shape == (1, TRUSTS, 20, 24)
    assert found.across.shape == (1, 3, 20, 24)


@pytest.mark.parametrize("shift", [(2.5, 0.0), (-2.0, 1.5), (0.0, -3.0)])
@pytest.mark.parametrize("reduction", [3, 4])
def test_warping_by_a_guess_finds_fast_motion(shift, reduction):
    error = errors(shift, reduction=reduction)
    assert min(error[REFINED], error[REFINED_COARSE]) < 0.6 * error[SMALL]
    assert min(error[REFINED], error[REFINED_COARSE]) < 0.25 * np.hypot(*shift)


@pytest.mark.parametrize("reduction", [3, 4])
def test_the_long_baseline_finds_slow_motion(reduction):
    error = errors((0.1, -0.05), reduction=reduction, noise=0.2)
    assert error[SLOW] < 0.7 * error[SMALL]


def test_every_candidate_has_the_sign_of_the_motion():
    found = evidence(log_counts((0.8, -0.6), reduction=4), 4).motion[0, :, :, 4:-4, 4:-4].mean((2, 3))
    assert (found[:, 0] > 0.4).all()
    assert (found[:, 1] < -0.3).all()


def test_no_events_are_no_motion():
    found = evidence(torch.zeros(1, 5, 2, 24, 36), 3)
    assert found.motion.abs().max() == 0
    assert found.trust.abs().max() == 0
