# pyright: basic
"""Functions compiled for the CPU, compiled once more for CUDA kernels; and whether there is a GPU to run them."""

from functools import cache
from importlib.util import find_spec
from types import FunctionType
from typing import Any

import numba.core
import numba.cuda
import numpy as np

from evimo.errors import BadInput, MissingExtra

cuda: Any = numba.cuda  # its annotations know neither kernels nor numpy's types
SIMULATED = bool(numba.core.config.ENABLE_CUDASIM)  # pyright: ignore[reportAttributeAccessIssue]
if not SIMULATED:
    cuda.dispatcher.config.CUDA_LOW_OCCUPANCY_WARNINGS = 0  # kernels of few threads are meant
np.__dict__.setdefault("row_stack", np.vstack)  # numba-cuda 0.30 asks for it when it compiles; NumPy 2.5 dropped it
THREADS = 128  # in a block, where they need no neighbours


@cache
def on_device(compiled: Any) -> Any:
    """A numba function, and those it calls, as functions that CUDA kernels can call: the same code, compiled anew."""
    code, names = compiled.py_func.__code__, compiled.py_func.__globals__
    callees = {name: on_device(names[name]) for name in code.co_names if hasattr(names.get(name), "py_func")}
    again = FunctionType(code, {**names, **callees}, code.co_name)
    return again if SIMULATED else cuda.jit(device=True)(again)  # the simulator takes plain functions


def uploaded(arrays: Any) -> Any:
    """A NamedTuple of arrays, on the GPU."""
    return type(arrays)(*(cuda.to_device(values) for values in arrays))


def blocks(number: int) -> int:
    """Blocks of THREADS for so many threads."""
    return -(-number // THREADS)


def check_cuda() -> None:
    """Make sure that CUDA kernels can run; numba's simulator of a GPU will do.

    Raises:
        BadInput: numba-cuda is not installed, or it finds no GPU.
    """
    if SIMULATED:
        return
    if find_spec("numba_cuda") is None:
        raise MissingExtra("device cuda needs numba-cuda", extra="cuda")
    if not cuda.is_available():
        raise BadInput("no NVIDIA GPU that CUDA can use", fix="--device cpu, or see what nvidia-smi says")
