"""Orbits: exact rates, never at rest, and toys that face the way they go."""

import numpy as np
import pytest

from evimo.scene.drawing.orbits import Heading, Orbit
from evimo.scene.motion import rotation_from_vector

TIMES, STEP = np.linspace(0, 3, 400), 1e-5
ACROSS, ALONG = np.array([0.8, 0.0, 0.0]), np.array([0.0, 0.5, 0.0])


def orbit(along=ALONG):
    return Orbit(ACROSS, along, 0.7, 0.4, np.zeros(3))


@pytest.mark.parametrize("curve", [orbit(), orbit(-ALONG), Heading(0.6, 0.7, 0.4), Heading(-0.6, 0.7, 0.4)])
def test_rates_are_those_of_the_values(curve):
    numeric = (curve(TIMES + STEP)[0] - curve(TIMES - STEP)[0]) / (2 * STEP)
    np.testing.assert_allclose(curve(TIMES)[1], numeric, atol=1e-6)


def test_an_orbit_is_about_its_middle_and_never_slow():
    period = np.linspace(0, 1 / 0.7, 200, endpoint=False)
    value, rate = orbit()(period)
    np.testing.assert_allclose(value.mean(axis=0), 0, atol=1e-9)
    assert np.linalg.norm(rate, axis=1).min() == pytest.approx(0.5, rel=1e-3)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_heading_faces_the_way_of_its_orbit(sign):
    """On and on: it never jumps by a whole turn."""
    vectors, _ = Heading(sign * 0.625, 0.7, 0.4)(TIMES)
    _, rate = orbit(sign * ALONG)(TIMES)
    ahead = rotation_from_vector(vectors) @ np.array([1.0, 0.0, 0.0])
    np.testing.assert_allclose(ahead, rate / np.linalg.norm(rate, axis=1)[:, None], atol=1e-9)
    assert np.abs(np.diff(vectors[:, 2])).max() < 0.2
