"""How the scene's functions are compiled, without fast-math: cached code would render other pictures than new code.

`scalar` functions take and give numbers and read arrays; CUDA kernels call the very same ones. They have no lists, no
exceptions and no new arrays, and float32 constants by name, since numba promotes float32 with a bare float literal to
float64. numba counts no references in them: counting those of a NamedTuple's arrays takes longer than all arithmetic.
"""

import numba

scalar = numba.njit(nogil=True, error_model="numpy", cache=True, _nrt=False)  # pyright: ignore[reportCallIssue]
jit = numba.njit(nogil=True, error_model="numpy", cache=True)
parallel = numba.njit(nogil=True, error_model="numpy", cache=True, parallel=True)
