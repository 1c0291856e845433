"""How the scene's functions are compiled, without fast-math: cached code would render other pictures than new code.

`lean` functions create no arrays, nor return any to others, since numba counts no references in them: counting those of
a NamedTuple's arrays at every call takes longer than the arithmetic. Those of them that take and give numbers (hits.py,
shadows.py, shading.py) are also what CUDA kernels call: no lists, no exceptions, and float32 constants by name, since
numba promotes float32 with a bare float literal to float64.

Compiled code is cached until its own file changes, but it contains what it calls in other files: so the cache is told
about all of them.
"""

from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

from evimo.compiling import njit

Compiled = Callable[[Any], Any]
KERNELS = ("compiling", "film", "hits", "mesh_hits", "shading", "shadows", "tiles", "../meshes/trees")


def compiler(folder: Path, names: tuple[str, ...]) -> Callable[..., Compiled]:
    """A decorator, with numba's options, for functions that call others in these modules, paths from a folder on."""
    stamp = sha256(b"".join((folder / f"{name}.py").read_bytes() for name in names)).hexdigest()

    def compiled(**options: Any) -> Compiled:
        def compile_(function: Any) -> Any:
            made = njit(nogil=True, error_model="numpy", **options)(function)
            index: Any = getattr(getattr(made, "_cache", None), "_cache_file", None)  # not part of numba's interface
            if hasattr(index, "_source_stamp"):
                index._source_stamp = (index._source_stamp, stamp)
            return made

        return compile_

    return compiled


_compiled = compiler(Path(__file__).parent, KERNELS)
lean = _compiled(_nrt=False)
inlined = _compiled(_nrt=False, forceinline=True)  # a lean function of so many arrays that passing them takes long
jit = _compiled()
parallel = _compiled(parallel=True)
