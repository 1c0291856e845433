"""Logarithm and exponential of float32 against those of float64."""

import numba
import numpy as np

from evimo.events.logarithms import exp, ln


@numba.njit
def both(x, logarithms, exponentials):
    for i in range(len(x)):
        logarithms[i], exponentials[i] = ln(x[i]), exp(-x[i])


def found(x):
    x = np.float32(x)
    out = np.empty((2, len(x)), np.float32)
    both(x, *out)
    return x.astype(np.float64), *out


def test_they_are_right_to_the_last_bits():
    x, logarithms, exponentials = found(np.exp(np.random.default_rng(0).uniform(-12, np.log(80), 500_000)))
    np.testing.assert_array_max_ulp(logarithms, np.log(x).astype(np.float32), maxulp=4)
    np.testing.assert_array_max_ulp(exponentials, np.exp(-x).astype(np.float32), maxulp=3)


def test_known_values():
    _, logarithms, exponentials = found([1, 2, 0.5, 0, 1e-30])
    assert logarithms[:3].tolist() == [0, np.float32(np.log(2)), -np.float32(np.log(2))]
    assert exponentials[3:].tolist() == [1, 1]


def test_exponentials_fade_to_nothing():
    x, _, exponentials = found([80, 90, 100, 103, 110, 1e6, np.inf])
    np.testing.assert_allclose(exponentials, np.exp(-x), rtol=1e-6, atol=1.5e-45)
    assert exponentials[-3:].tolist() == [0, 0, 0]


def test_exponentials_of_positive_numbers():
    x = np.linspace(0, 87, 100_001, dtype=np.float32)
    np.testing.assert_allclose(found(-x)[2], np.exp(x.astype(np.float64)), rtol=4e-7)


@numba.njit(fastmath=True)
def loosely(x, exponentials):
    for i in range(len(x)):
        exponentials[i] = exp(x[i])


def test_callers_that_compile_with_fast_math_get_the_same():
    x = np.linspace(-20, 20, 1001, dtype=np.float32)
    exponentials = np.empty_like(x)
    loosely(x, exponentials)
    np.testing.assert_array_equal(exponentials, found(-x)[2])
