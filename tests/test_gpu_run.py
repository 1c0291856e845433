"""What a loan of a GPU leaves, the next one takes up; and without a GPU it says so."""

import importlib
import subprocess
import sys
from pathlib import Path

import pytest
import torch

from evimo.errors import BadFile

BENCH = Path(__file__).parents[1] / "bench"


@pytest.fixture
def gpu_run(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCH))
    module = importlib.import_module("gpu_run")
    monkeypatch.setattr(module, "PIECE", 1000)
    return module


@pytest.fixture
def left(gpu_run, tmp_path):
    """A folder with a state of 2,500 bytes, its weights and its log."""
    scratch, out = tmp_path / "scratch", tmp_path / "out"
    scratch.mkdir(), out.mkdir()
    (scratch / "state.safetensors").write_bytes(bytes(range(250)) * 10)
    (scratch / "model.safetensors").write_bytes(b"weights")
    gpu_run.split_state(scratch, out, 7)
    (out / "log.csv").write_text("step,loss\n7,1\n")
    return out


def test_a_state_comes_back_from_its_pieces(gpu_run, left, tmp_path):
    pieces = ["state.0", "state.1", "state.2"]
    assert sorted(path.name for path in left.iterdir()) == ["log.csv", "model.safetensors", *pieces, "state.json"]
    again = tmp_path / "again"
    again.mkdir()
    gpu_run.join_state(left, again)
    assert (again / "state.safetensors").read_bytes() == bytes(range(250)) * 10
    assert (again / "log.csv").read_text() == "step,loss\n7,1\n"


def test_pieces_of_different_steps_are_refused(gpu_run, left, tmp_path):
    (left / "state.1").write_bytes(b"of a later step")
    with pytest.raises(BadFile, match="not whole"):
        gpu_run.join_state(left, tmp_path)


@pytest.mark.slow
@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU")
def test_without_a_gpu_it_says_so(tmp_path):
    command = [sys.executable, str(BENCH / "gpu_run.py"), "--seconds", "60", "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.startswith("error: no NVIDIA GPU that PyTorch can use") and "Traceback" not in done.stderr
