"""Commands on a dataset's own files: train, evaluate and view take what the datasets hold."""

import pytest
from tests.recordings.dataset_files import v1_bag, v1_npz, v2_folder

from evimo.cli import main


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    root = tmp_path_factory.mktemp("data")
    v1_npz(root / "train" / "box" / "npz" / "seq_00.npz")
    v2_folder(root / "left_camera" / "imo" / "eval" / "scene13_dyn_test_00_000000")
    v1_bag(root / "train" / "box" / "raw" / "seq_00")
    return root


def test_train_takes_the_files_of_both_datasets(data, tmp_path, capsys):
    command = ["train", str(data), "--preset", "tiny", "--steps", "2", "--batch", "2", "--out", str(tmp_path / "run")]
    assert main(command) == 0
    assert (tmp_path / "run" / "model.onnx").exists()
    assert main([*command[:-1], str(tmp_path / "none"), "--split", "evimo2-imo"]) == 2
    assert "in the train part of evimo2-imo" in capsys.readouterr().err


def test_evaluate_takes_the_files_of_both_datasets(data, tmp_path, capsys):
    assert main(["evaluate", str(data), "--model", "classical", "--out", str(tmp_path)]) == 0
    assert "background box" in capsys.readouterr().out
    assert main(["evaluate", str(data), "--split", "paper2019"]) == 2
    assert "in the test part of paper2019" in capsys.readouterr().err


def test_view_shows_a_datasets_truth(data, tmp_path):
    video = tmp_path / "a.mp4"
    assert main(["view", str(data / "train" / "box" / "npz" / "seq_00.npz"), "--save", str(video)]) == 0
    assert video.stat().st_size > 1000
