import csv
import os
import subprocess
import sys

import numpy as np
import pytest
import torch

from evimo.cli import main
from evimo.errors import how_to_install
from evimo.simulate.dataset import DatasetPlan, simulate_dataset
from evimo.simulate.plan import RecordingPlan
from evimo.streaming.inference import Network
from evimo.streaming.models import model_of
from evimo.streaming.one_look import OneLookNetwork

LEFT = ["log.csv", "model.first.onnx", "model.onnx", "model.safetensors", "state.safetensors", "tensorboard"]

pytest.importorskip("tensorboard", reason="TensorBoard is not installed: it comes with evimo[train]")


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Two simulated recordings of 0.15 s and 64x48 px."""
    out = tmp_path_factory.mktemp("simulated")
    first = RecordingPlan(seed=3, set_number=1, seconds=0.15, camera="evimo", size=(48, 64))
    plan = DatasetPlan(first=first, minutes=0.3 / 60)
    assert len(list(simulate_dataset(plan, out))) == 2
    return out


@pytest.fixture(scope="module")
def run(recordings, tmp_path_factory):
    """A finished run of three steps, and the arguments that made it."""
    out = tmp_path_factory.mktemp("run")
    options = ["--preset", "tiny", "--out", str(out), "--steps", "3", "--batch", "2", "--threads", "1"]
    arguments = ["train", str(recordings), *options]
    # In a process of its own: tests check the shapes of every call, which the exporter would trace.
    trained(arguments)
    return out, arguments


def trained(arguments):
    command = [sys.executable, "-m", "evimo.cli", *arguments]
    subprocess.run(command, check=True, capture_output=True, env={**os.environ, "OMP_NUM_THREADS": "1"})


@pytest.mark.parametrize(
    ("option", "value"),
    [
        *(("--steps", "0"), ("--steps", "-3"), ("--batch", "0"), ("--samples-per-slice", "0"), ("--threads", "-1")),
        *(("--workers", "0"), ("--workers", "-2")),
        *(("--learning-rate", "nan"), ("--learning-rate", "-1"), ("--seed", "-1"), ("--validate-every", "0")),
    ],
)
def test_numbers_that_no_run_can_have_are_refused_before_anything_is_made(option, value, tmp_path, capsys):
    out = tmp_path / "run"
    assert main(["train", str(tmp_path), "--out", str(out), option, value]) == 2
    said = capsys.readouterr().err
    assert said.startswith("error: ") and f"{value} " in f"{said.splitlines()[0]} "
    assert not out.exists()


@pytest.mark.slow
def test_a_run_leaves_a_model_to_train_one_to_run_and_a_log(run):
    out, _ = run
    assert sorted(path.name for path in out.iterdir()) == LEFT
    with (out / "log.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["step"] for row in rows] == ["1", "2", "3"]
    assert all(np.isfinite(float(row["loss"])) for row in rows)
    assert Network(out / "model.onnx").stride == 32


@pytest.mark.slow
def test_the_rival_is_trained_by_its_own_recipe_into_one_file(recordings, tmp_path, capsys):
    options = ["--preset", "ecn", "--steps", "2", "--batch", "2", "--threads", "1"]
    trained(["train", str(recordings), *options, "--recipe", "ecn", "--out", str(tmp_path / "run")])
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == [n for n in LEFT if n != "model.first.onnx"]
    assert isinstance(model_of(tmp_path / "run" / "model.onnx"), OneLookNetwork)
    assert main(["train", str(recordings), *options, "--out", str(tmp_path / "other")]) == 2
    assert "--recipe ecn" in capsys.readouterr().err


@pytest.mark.slow
def test_the_same_command_goes_on_where_it_stopped(run):
    out, arguments = run
    before = (out / "model.safetensors").read_bytes()
    trained(arguments)  # all three steps are done
    assert (out / "model.safetensors").read_bytes() == before
    assert len((out / "log.csv").read_text().splitlines()) == 4


@pytest.mark.slow
def test_other_options_in_the_same_folder_are_refused(run, capsys):
    _, arguments = run
    assert main([*arguments, "--seed", "1"]) == 2
    assert "differs in seed" in capsys.readouterr().err


@pytest.mark.slow
def test_scenes_are_filmed_meanwhile_beside_a_folder_and_scores_are_told(recordings, tmp_path):
    folders = [str(recordings), "--validate", str(recordings), str(recordings), "--validate-every", "1"]
    options = ["--preset", "tiny", "--steps", "2", "--batch", "2", "--workers", "2", "--threads", "1"]
    trained(["train", *folders, "--simulate", "replica,stress", "--out", str(tmp_path), *options])
    assert sorted(path.name for path in tmp_path.iterdir()) == [*LEFT, "validation.csv"]
    with (tmp_path / "validation.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["step"] for row in rows] == ["1", "2"]
    assert 0 <= float(rows[1]["event_iou"]) <= 1


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU")
def test_no_gpu_is_one_clear_error(tmp_path, capsys):
    options = ["--simulate", "replica", "--device", "cuda", "--out", str(tmp_path / "run")]
    assert main(["train", *options]) == 2
    assert capsys.readouterr().err == (
        "error: no NVIDIA GPU that PyTorch can use\n  try: --device cpu, or see what nvidia-smi says\n"
    )
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--preset", "huge"], "no model 'huge'"),
        (["--recipe", "soup"], "no recipe 'soup'"),
        (["--simulate", "replica,circus"], "no population 'circus'"),
        (["--preset", "missing.safetensors"], "no model 'missing.safetensors'"),
    ],
)
def test_a_wrong_name_is_one_clear_error(options, words, recordings, tmp_path, capsys):
    assert main(["train", str(recordings), "--out", str(tmp_path / "run"), *options]) == 2
    said = capsys.readouterr().err
    assert f"error: {words}" in said and "try: one of" in said
    assert not (tmp_path / "run").exists()


def test_recordings_that_are_learned_from_and_validated_on_are_said(recordings, tmp_path, capsys):
    first, second = sorted(path for path in recordings.iterdir() if path.is_dir())
    wrong = ["--recipe", "soup", "--out", str(tmp_path / "run")]  # ends it before it trains
    assert main(["train", str(first), "--validate", str(recordings), *wrong]) == 2
    assert f"warning: {first} is learned from and validated on" in capsys.readouterr().err
    assert main(["train", str(first), "--validate", str(second), *wrong]) == 2
    assert "warning" not in capsys.readouterr().err


def test_an_empty_folder_is_one_clear_error(tmp_path, capsys):
    assert main(["train", str(tmp_path), "--out", str(tmp_path / "run")]) == 2
    assert "evimo simulate" in capsys.readouterr().err


def test_no_folder_at_all_is_one_clear_error(tmp_path, capsys):
    assert main(["train", "--out", str(tmp_path / "run")]) == 2
    assert "Traceback" not in "".join(capsys.readouterr())


def test_without_torch_it_says_what_to_install(recordings, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "torch", None)
    assert main(["train", str(recordings), "--out", str(tmp_path / "run")]) == 2
    assert how_to_install("train") in capsys.readouterr().err
