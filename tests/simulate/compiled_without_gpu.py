"""Compile every CUDA kernel of the simulator for a GPU that is not here, for test_compiled.py; prints their names.

What a GPU would hold stays in NumPy arrays, and a kernel that is called is compiled with the types of that very call
instead of being launched. A process of its own, since numba-cuda is changed under the simulator's feet.
"""

import sys
from dataclasses import replace
from types import SimpleNamespace

import numba
import numba.cuda
import numpy as np
from numba.cuda.dispatcher import CUDADispatcher

from evimo.simulate.plan import RecordingPlan
from evimo.simulate.recording import simulate_recording

CAPABILITY = (9, 0)  # H100 and H200


class OnHost(np.ndarray):
    """An array that claims to be on a GPU."""

    def copy_to_host(self):
        return np.asarray(self)

    def copy_to_device(self, values):
        """Nothing was computed that could be copied."""


class Launch:
    """Stands for a kernel with its grid: a call compiles it for the types of the arguments."""

    def __init__(self, dispatcher):
        self.dispatcher = dispatcher

    def __call__(self, *arguments):
        function = self.dispatcher.py_func
        types = tuple(numba.typeof(plain(each)) for each in arguments)
        if (function, types) not in compiled:
            compiled.add((function, types))
            ptx, _ = numba.cuda.compile(function, numba.void(*types), cc=CAPABILITY, output="ptx")
            assert f".target sm_{CAPABILITY[0]}{CAPABILITY[1]}" in ptx
            print(f"{function.__module__}.{function.__name__}", flush=True)


compiled = set()


def plain(value):
    """An argument as numba would see it on a GPU."""
    if isinstance(value, OnHost):
        return np.asarray(value)
    if isinstance(value, tuple):
        parts = [plain(each) for each in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return value


def kept_on_host():
    """Let arrays that are meant for a GPU stay here, and kernels be compiled instead of launched."""
    numba.cuda.to_device = lambda values: np.ascontiguousarray(np.atleast_1d(values)).view(OnHost)
    numba.cuda.device_array = lambda shape, dtype: np.zeros(shape, dtype).view(OnHost)
    numba.cuda.device_array_like = lambda values: np.zeros_like(values).view(OnHost)
    CUDADispatcher.__getitem__ = lambda dispatcher, _: Launch(dispatcher)
    device = SimpleNamespace(compute_capability=CAPABILITY, id=0)
    for name, module in list(sys.modules.items()):
        if name.startswith("numba.cuda") and hasattr(module, "get_current_device"):
            module.get_current_device = lambda: device


if __name__ == "__main__":
    kept_on_host()
    drawn = simulate_recording(RecordingPlan(seed=1, set_number=2, seconds=0.05, size=(24, 32)))
    list(replace(drawn, plan=replace(drawn.plan, device="cuda")))
