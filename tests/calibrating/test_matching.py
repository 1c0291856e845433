"""Markers are recognised in any order, with strangers and gaps, and never guessed where two ways fit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from evimo.calibrating.matching import match_markers
from evimo.calibrating.rigid import angle_between, fit_rigid, inverse, moved, pose
from evimo.errors import BadInput

CAR = np.array(((4.5, 10.0, 11.3), (42.2, 34.1, -61.3), (41.0, -29.2, 18.6), (-36.5, -30.4, 75.0), (-43.2, 28.2, -4.8)))
CAR = CAR / 1e3


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), missing=st.integers(0, 1), strangers=st.integers(0, 3))
def test_any_order_some_missing_and_some_others(seed, missing, strangers):
    rng = np.random.default_rng(seed)
    body_from_scan = pose(Rotation.random(rng=rng).as_matrix(), rng.uniform(-1, 1, 3))
    order = rng.permutation(5)[missing:]
    body = moved(body_from_scan, CAR[order]) + rng.normal(0, 2e-4, (len(order), 3))
    scan = np.concatenate((CAR, rng.uniform(-0.3, -0.15, (strangers, 3))))
    match = match_markers(scan, body)
    assert dict(match.pairs.tolist()) == {int(mine): at for at, mine in enumerate(order)}
    assert np.degrees(angle_between(match.body_from_scan, body_from_scan)) < 1.0
    assert match.rms < 5e-4


@pytest.mark.parametrize("seed", range(5))
def test_balls_near_the_markers_do_not_hide_them(seed):
    """Of eight balls beside the markers three fit as well, nearly in the same place: all five markers fit better."""
    rng = np.random.default_rng(seed)
    balls = CAR[rng.integers(0, 5, 8)] + rng.normal(0, 0.004, (8, 3))
    body_from_scan = pose(Rotation.random(rng=rng).as_matrix(), rng.uniform(-1, 1, 3))
    match = match_markers(np.concatenate((balls, CAR)), moved(body_from_scan, CAR))
    assert match.pairs.tolist() == [[8 + number, number] for number in range(5)]
    assert match.rms < 1e-9


def test_two_ways_that_fit_equally_are_an_error():
    square = np.array(((0.0, 0, 0), (0.1, 0, 0), (0.1, 0.1, 0), (0, 0.1, 0)))
    with pytest.raises(BadInput, match="ways"):
        match_markers(square, square + 0.5)


def test_a_mirror_image_is_no_match():
    with pytest.raises(BadInput, match=r"no three|ways"):
        match_markers(CAR, CAR * (1, 1, -1), tolerance=5e-4)


@pytest.mark.parametrize(
    ("scan", "body", "says"),
    [
        (CAR[:2], CAR, "the scan has 2 markers"),
        (CAR, np.full((4, 3), np.nan), "no place"),
        (CAR, 1e3 * CAR, "no three"),
        (np.outer(np.arange(4), (0.01, 0.02, 0.03)), CAR, "on a line"),
    ],
)
def test_what_cannot_be_matched_says_why(scan, body, says):
    with pytest.raises(BadInput, match=says):
        match_markers(scan, body)


def test_a_rigid_fit_is_no_mirror_image_even_in_a_plane():
    flat = np.array(((0.0, 0, 0), (1, 0, 0), (0, 2, 0), (3, 1, 0)))
    a_from_b = pose(Rotation.from_euler("xyz", (20, 50, 170), degrees=True).as_matrix(), np.array((1.0, 2, 3)))
    assert np.allclose(fit_rigid(moved(a_from_b, flat), flat), a_from_b)
    assert np.allclose(inverse(a_from_b) @ a_from_b, np.eye(4))
