# pyright: basic
"""Natural logarithm and exponential in float32, compiled so that loops over them run on vectors.

They are ratios of polynomials with NumPy's coefficients and order of operations (BSD-3-Clause), bit for bit its float32
`np.log` and `np.exp` where it has AVX2 or AVX-512, and the same on every other processor.
"""

from typing import Any

import numpy as np
from numba.core import types
from numba.extending import intrinsic

from evimo.compiling import njit

f32, i32 = np.float32, np.int32
MANTISSA, HALF, BIAS = i32(0x7FFFFF), i32(126 << 23), i32(126)  # bits of a number in [0.5, 1) and of its exponent
SQRT_HALF, LN_2, LOG2_E = f32(0.5**0.5), f32(np.log(2)), f32(np.log2(np.e))
LN_2_HIGH, LN_2_LOW = f32(6.93145752e-1), f32(1.42860677e-6)
ROUNDER = f32(1.5 * 2**23)  # added and taken away again, it leaves a whole number
LEAST = f32(-103.972084)  # below it exp is 0

_LN_OVER = tuple(
    f32(c) for c in (2.589979117907922693523e-02, 3.808837741388407920751e-01, 1.480000633576506585156,
                     2.112677543073053063722, 9.999999999999998702752e-01, 0.0)
)  # fmt: skip
_LN_UNDER = tuple(
    f32(c) for c in (5.875095403124574342950e-03, 1.546476374983906719538e-01, 9.864942958519418960339e-01,
                     2.453006071784736363091, 2.612677543073109236779, 1.0)
)  # fmt: skip
_EXP_OVER = tuple(
    f32(c) for c in (5.082762527590693718096e-04, 6.757896990527504603057e-03, 5.114512081637298353406e-02,
                     2.473615434895520810817e-01, 7.257664613233124478488e-01, 9.999999999980870924916e-01)
)  # fmt: skip
_EXP_UNDER = tuple(f32(c) for c in (2.159509375685829852307e-02, -2.742335390411667452936e-01, 1.0))

# Exact arithmetic is asked for aloud: else a `fastmath` caller that compiles them first would have its own way, and
# the cache would keep it for all.
_jit = njit(nogil=True, fastmath=False, error_model="numpy")


def _multiply_add(typing_context, a, b, c):
    """a b + c, rounded once."""
    float32 = types.float32
    return float32(float32, float32, float32), lambda context, builder, signature, values: builder.fma(*values)


_fma: Any = intrinsic(_multiply_add)


@_jit
def ln(x):
    """The natural logarithm of a normal positive number."""
    bits = f32(x).view(i32)
    exponent = f32((bits >> i32(23)) - BIAS)
    part = i32((bits & MANTISSA) | HALF).view(f32)
    small = part <= SQRT_HALF
    exponent = exponent - f32(1) if small else exponent
    r = (part + part if small else part) - f32(1)
    a, b = _LN_OVER, _LN_UNDER
    over = _fma(_fma(_fma(_fma(_fma(a[0], r, a[1]), r, a[2]), r, a[3]), r, a[4]), r, a[5])
    under = _fma(_fma(_fma(_fma(_fma(b[0], r, b[1]), r, b[2]), r, b[3]), r, b[4]), r, b[5])
    return _fma(exponent, LN_2, over / under)


@_jit
def exp(x):
    """The exponential of a number up to 88."""
    x = max(x, LEAST)
    whole = (x * LOG2_E + ROUNDER) - ROUNDER
    r = _fma(whole, -LN_2_LOW, _fma(whole, -LN_2_HIGH, x))
    a, b = _EXP_OVER, _EXP_UNDER
    over = _fma(_fma(_fma(_fma(_fma(a[0], r, a[1]), r, a[2]), r, a[3]), r, a[4]), r, a[5])
    under = _fma(_fma(b[0], r, b[1]), r, b[2])
    power = i32(whole)
    first = power >> i32(1)  # in two steps: the whole power may be less than float32 has
    return over / under * _two_to(first) * _two_to(power - first)


@_jit
def _two_to(power):
    return i32((power + i32(127)) << i32(23)).view(f32)
