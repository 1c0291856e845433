"""How the scene's functions are compiled, without fast-math: cached code would render other pictures than new code.

`lean` functions create no arrays, and numba counts no references in them: counting those of a NamedTuple's arrays at
every call takes longer than the arithmetic. Those of them that take and give numbers (hits.py, shading.py) are also
what CUDA kernels call: no lists, no exceptions, and float32 constants by name, since numba promotes float32 with a
bare float literal to float64.
"""

import numba

lean = numba.njit(nogil=True, error_model="numpy", cache=True, _nrt=False)  # pyright: ignore[reportCallIssue]
scalar = lean  # its old name, in mesh_hits.py
jit = numba.njit(nogil=True, error_model="numpy", cache=True)
parallel = numba.njit(nogil=True, error_model="numpy", cache=True, parallel=True)
