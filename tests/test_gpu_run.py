"""What a loan of a GPU leaves, the next one takes up; and without a GPU it says so."""

import importlib
import json
import os
import re
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, packages_distributions, requires
from pathlib import Path
from types import SimpleNamespace

import pytest
import torch

import evimo
from evimo.errors import BadFile
from evimo.model.checkpoint import save_tensors

BENCH = Path(__file__).parents[1] / "bench"
THERE = (
    *("numpy", "torch", "numba", "numba-cuda", "scipy", "opencv-python-headless", "h5py", "safetensors"),
    *("scikit-image", "pyyaml", "rich", "jaxtyping"),
)
FILMED = """
import sys

sys.modules |= dict.fromkeys(sys.argv[1:])  # not to be found
import evimo.training.logs
import evimo.training.start
from evimo.training.film_plan import FilmPlan

plan = FilmPlan(
    populations=("replica", "stress"), batch=2, seed=0, samples_per_slice=1, seconds=0.025, size=(32, 48)
)
print(all(len(plan.recording(place, 0)) == 1 for place in range(2)))
"""


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


def test_the_step_that_is_told_is_that_of_the_state_that_is_left(gpu_run, tmp_path):
    """Where time is up while weights change, the trainer is ahead of what it saved last."""
    out = tmp_path / "out"
    out.mkdir()
    save_tensors({"model.weight": torch.zeros(3)}, tmp_path / "state.safetensors", step=7)
    (tmp_path / "model.safetensors").write_bytes(b"weights")
    pace, learner = SimpleNamespace(samples_per_s=2.0, waited=0.5), SimpleNamespace(replays_graph=True)
    report = {}
    gpu_run.note(SimpleNamespace(out=tmp_path, step=9, pace=pace, learner=learner), out, report)
    assert json.loads((out / "state.json").read_text())["step"] == report["step"] == 7
    assert json.loads((out / "report.json").read_text()) == report


@pytest.mark.slow
@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU")
def test_without_a_gpu_it_says_so(tmp_path):
    command = [sys.executable, str(BENCH / "gpu_run.py"), "--seconds", "60", "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.startswith("error: no NVIDIA GPU that PyTorch can use") and "Traceback" not in done.stderr


def with_what_they_need(names):
    """These packages and all that they require, extras left out."""
    found, waiting = set(), [re.sub(r"[-_.]+", "-", name).lower() for name in names]
    while waiting:
        if (name := waiting.pop()) not in found:
            found.add(name)
            try:
                needs = [need for need in requires(name) or () if "extra ==" not in need]
            except PackageNotFoundError:
                continue
            waiting += [re.sub(r"[-_.]+", "-", re.match(r"[\w.-]+", need)[0]).lower() for need in needs]
    return found


@pytest.mark.slow
def test_training_and_films_need_no_package_that_a_borrowed_gpu_lacks():
    """evimo is on the path alone; all else that is installed here counts as missing."""
    there = with_what_they_need(THERE)
    missing = [
        top
        for top, owners in packages_distributions().items()
        if top != "evimo" and not there & {re.sub(r"[-_.]+", "-", owner).lower() for owner in owners}
    ]
    assert {"lz4", "onnxruntime", "cyclopts"} <= set(missing)
    path = {**os.environ, "PYTHONPATH": str(Path(evimo.__file__).parents[1])}
    done = subprocess.run([sys.executable, "-c", FILMED, *missing], capture_output=True, text=True, env=path)
    assert done.stdout == "True\n", done.stderr
