import csv
from dataclasses import replace

import numpy as np
import pytest
import torch

from evimo.errors import BadFile, BadInput, NotFound
from evimo.model.checkpoint import save_model
from evimo.model.networks import network_of
from evimo.model.presets import PRESETS
from evimo.training import start as module
from evimo.training.config import TrainConfig
from evimo.training.logs import log_rows
from evimo.training.start import Workplace, started, training_samples


@pytest.fixture
def on_disk(monkeypatch, recording, without_events, small_crops, tmp_path):
    """Makes folders whose prepared recordings are known worlds of two sizes, or without events."""

    def made(dark=()):
        worlds = {}
        for name, size in (("a", (18, 36)), ("b", (36, 18)), ("c", (18, 36))):
            (tmp_path / name).mkdir()
            (tmp_path / name / "dataset_sim.npz").touch()
            world = recording(size=size, slices=3)
            worlds[tmp_path / name] = without_events(world) if name in dark else world
        monkeypatch.setattr(module, "prepare", lambda folder: folder)
        monkeypatch.setattr(module, "open_prepared", worlds.__getitem__)
        return [tmp_path]

    return made


def test_samples_are_all_slices_of_all_recordings_of_any_size(on_disk):
    told = []
    samples = training_samples(on_disk(), lambda *progress: told.append(progress))
    assert [each.valid.shape for each in samples.recordings] == [(18, 36), (36, 18), (18, 36)]
    assert np.bincount(samples.index[:, 0]).tolist() == [3, 3, 3]
    assert told == [(1, 3), (2, 3), (3, 3)]


def test_recordings_without_events_are_left_out(on_disk):
    samples = training_samples(on_disk(dark="ac"), lambda *_: None)
    assert samples.index.tolist() == [[1, 0], [1, 1], [1, 2]]


def test_nothing_but_recordings_without_events(on_disk):
    with pytest.raises(BadFile, match="an event"):
        training_samples(on_disk(dark="abc"), lambda *_: None)


def test_a_run_starts_from_its_seed_and_goes_on_in_its_folder(on_disk, tmp_path):
    config, data = TrainConfig(steps=1, batch=1), on_disk()

    def begun(config):
        with started(data, "tiny", config, Workplace(out=tmp_path / "run"), progress=lambda *_: None) as trainer:
            return trainer

    one, same, other = begun(config), begun(config), begun(replace(config, seed=1))
    weights = [next(iter(trainer.learner.model.parameters())) for trainer in (one, same, other)]
    assert weights[0].equal(weights[1]) and not weights[0].equal(weights[2])
    one.run(lambda *_: None)
    assert begun(config).step == 1
    data[:] = [tmp_path / "a"]
    with pytest.raises(BadInput, match="differs in recordings"):
        begun(config)


def test_a_run_that_began_from_other_weights_is_another_run(on_disk, tmp_path):
    config, data, weights = TrainConfig(steps=1, batch=1), on_disk(), tmp_path / "first.safetensors"

    def begun():
        with started(data, str(weights), config, Workplace(out=tmp_path / "run"), progress=lambda *_: None) as trainer:
            return trainer

    torch.manual_seed(1)
    save_model(network_of(PRESETS["tiny"]), weights)
    begun().run(lambda *_: None)
    assert begun().step == 1
    save_model(network_of(PRESETS["tiny"]), weights)
    with pytest.raises(BadInput, match="differs in first weights"):
        begun()


@pytest.mark.parametrize(
    ("preset", "config", "workplace", "words"),
    [
        ("huge", {}, {}, "huge"),
        ("tiny", {"simulate": ("circus",)}, {}, "circus"),
        ("tiny", {}, {"device": "tpu"}, "no device 'tpu'"),
    ],
)
def test_what_is_wrong_is_said_before_anything_is_prepared(preset, config, workplace, words, tmp_path):
    run = started(
        [tmp_path],
        preset,
        TrainConfig(**config),
        Workplace(out=tmp_path, **workplace),
        progress=lambda *_: pytest.fail("late"),
    )
    with pytest.raises((NotFound, BadInput), match=words), run:
        pass


def test_nothing_to_learn_from(tmp_path):
    run = started([], "tiny", TrainConfig(), Workplace(out=tmp_path), progress=lambda *_: None)
    with pytest.raises(BadInput, match="--simulate"), run:
        pass


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU")
def test_no_gpu_is_said(tmp_path):
    workplace = Workplace(out=tmp_path, device="cuda")
    run = started([], "tiny", TrainConfig(simulate=("replica",)), workplace, progress=lambda *_: None)
    with pytest.raises(BadInput, match="--device cpu"), run:
        pass


def test_an_empty_folder(tmp_path):
    with pytest.raises(NotFound, match="evimo simulate"):
        training_samples([tmp_path], lambda *_: None)


def test_the_log_goes_on_under_one_header_after_the_step_of_the_checkpoint(tmp_path):
    for step in (1, 2, 2):  # killed after the second step, before its checkpoint
        with log_rows(tmp_path / "log.csv", step - 1) as row:
            row(step, {"loss": 1 / step, "mask": 0.25})
    with (tmp_path / "log.csv").open() as file:
        assert list(csv.reader(file)) == [["step", "loss", "mask"], ["1", "1", "0.25"], ["2", "0.5", "0.25"]]


def test_a_log_without_rows_is_no_file(tmp_path):
    with log_rows(tmp_path / "log.csv", 0):
        pass
    assert not (tmp_path / "log.csv").exists()


def test_more_recordings_than_files_may_be_open(monkeypatch, on_disk):
    resource = pytest.importorskip("resource")
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    if limits[1] != resource.RLIM_INFINITY and limits[1] < 600:
        pytest.skip("the hard limit is too low to be raised")
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (256, limits[1]))
        training_samples(on_disk(), lambda *_: None)
        assert resource.getrlimit(resource.RLIMIT_NOFILE)[0] > 512
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)


def test_a_shape_grows_from_a_smaller_model(on_disk, tmp_path):
    data, config, smaller = on_disk(), TrainConfig(steps=4), tmp_path / "smaller.safetensors"
    with started(data, "tiny", config, Workplace(out=tmp_path / "run"), progress=lambda *_: None) as trainer:
        save_model(trainer.averaged(), smaller)
    wide = replace(PRESETS["tiny"], hidden=8)
    module.PRESETS["wide"] = wide
    try:
        workplace = Workplace(out=tmp_path / "grown")
        with started(data, "wide", config, workplace, grown_from=smaller, progress=lambda *_: None) as trainer:
            model = trainer.learner.model
            assert model.config == wide
            listened = model.second_pass.network.heads[-1].weight.abs().amax((0, 2, 3)) > 0
            assert listened.tolist() == [True] * 6 + [False] * 2
        with (
            pytest.raises(BadInput, match="has weights of its own"),
            started(data, str(smaller), config, workplace, grown_from=smaller, progress=lambda *_: None),
        ):
            pass
    finally:
        del module.PRESETS["wide"]
