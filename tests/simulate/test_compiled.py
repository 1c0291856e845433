"""Every CUDA kernel compiles for a GPU, with the types of real calls, on a machine that has none."""

import subprocess
import sys
from collections import Counter
from importlib.util import find_spec
from pathlib import Path

import pytest

PROGRAM = Path(__file__).with_name("compiled_without_gpu.py")
KERNELS = {
    "evimo.scene.rays.cuda.bound": 1,
    "evimo.scene.rays.cuda.cast_centres": 1,
    "evimo.scene.rays.cuda.fill_lists": 1,
    "evimo.scene.rays.cuda.smooth_edges": 1,
    "evimo.simulate.cuda_film._weigh": 1,
    "evimo.simulate.cuda_pixels._expose": 1,
    "evimo.simulate.cuda_pixels.kernel": 2,  # events counted, and written
}


@pytest.mark.slow
@pytest.mark.skipif(
    find_spec("numba_cuda") is None or find_spec("cuda") is None,
    reason="numba-cuda is not installed: it comes with evimo[cuda]",
)
def test_every_kernel_compiles_without_a_gpu():
    done = subprocess.run([sys.executable, str(PROGRAM)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert Counter(done.stdout.split()) == KERNELS
