"""What `evimo benchmark` keeps, and when it scores anew."""

import gc
import json
import weakref
from contextlib import contextmanager

import numpy as np
import pytest
from tests.benchmark.written import MODELS, values_in

from evimo.cli import main
from evimo.simulate.benchmark_set import INDEX, BenchmarkPlan

pytest.importorskip("matplotlib", reason="needs the extra [benchmark]")


def test_what_was_scored_is_not_scored_again(no_page, command, runs, tmp_path):
    main(command)
    first = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir() if path.is_file()}
    assert runs == [(model, name) for name in ("d", "c", "a", "b") for model in ("half", "perfect")]
    main(command)
    assert len(runs) == 8
    assert {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir() if path.is_file()} == first
    next((tmp_path / "out" / "scores" / "half").glob("table_c-*.json")).write_text('{"of": ')  # cut short by a crash
    main(command)
    assert runs[8:] == [("half", "c")]


def test_recordings_are_let_go_once_they_are_scored(no_page, command, runs, monkeypatch):
    """Their events are mapped into memory, hours of them if they stayed open."""
    from evimo.benchmark import cases

    seen, tallies_of = [], cases.tallies_of

    def watched(recording, models, tick):
        gc.collect()
        assert not [left for left in seen if left() is not None]
        seen.append(weakref.ref(recording))
        return tallies_of(recording, models, tick)

    monkeypatch.setattr(cases, "tallies_of", watched)
    assert main(command) == 0
    assert len(seen) == 4


def test_a_benchmark_that_was_interrupted_goes_on(command, runs, tmp_path, monkeypatch):
    from evimo.benchmark import cases

    def interrupted(recording, models, tick):
        if recording.path.name == "a":
            raise KeyboardInterrupt
        return tallies_of(recording, models, tick)

    tallies_of = cases.tallies_of
    monkeypatch.setattr(cases, "tallies_of", interrupted)
    assert main(command) == 130
    assert not (tmp_path / "out" / "benchmark.html").exists()
    monkeypatch.setattr(cases, "tallies_of", tallies_of)
    assert main(command) == 0
    assert [name for model, name in runs if model == "half"] == ["d", "c", "a", "b"]


def test_a_job_that_is_done_again_finds_what_it_kept(recordings, tmp_path, monkeypatch):
    """A process that died after it kept its scores left the others to take its job again."""
    from evimo.benchmark import cases

    kept, sequence = cases.Kept(tmp_path / "scores"), cases.sequences_in(recordings)[0]
    case, scores = cases.score(kept, cases.case_of(sequence, cases.rivals_of(["classical"])))
    monkeypatch.setattr(cases, "tallies_of", lambda *_: pytest.fail("scored again"))
    again = cases.score(kept, case)[1]
    assert json.dumps(again["classical"].as_dict()) == json.dumps(scores["classical"].as_dict())


def test_models_score_side_by_side_what_they_score_alone(no_page, command, runs, recordings, tmp_path):
    main(command)
    together = values_in(tmp_path / "out")
    for model in ("half", "perfect"):
        alone = ["benchmark", "--data", str(recordings), "--out", str(tmp_path / model), "--models", model]
        assert main(alone) == 0
        found = values_in(tmp_path / model)
        assert found == {key: value for key, value in together.items() if key[2] not in {"half", "perfect"} - {model}}


def test_progress_names_the_recording_that_is_scored(no_page, command, runs, monkeypatch):
    told = []

    @contextmanager
    def progress(total, unit):
        yield lambda amount=1, *, made=True, facts="": told.append(facts)

    monkeypatch.setattr("evimo.cli.benchmark.progress", progress)
    assert main(command) == 0
    assert list(dict.fromkeys(filter(None, told))) == ["planar/d", "table/c", "wall/a", "wall/b"]


def test_two_processes_find_what_one_finds(no_page, recordings, tmp_path):
    for workers in ("1", "2"):
        words = ["--data", str(recordings), "--out", str(tmp_path / workers), "--workers", workers]
        assert main(["benchmark", *words, "--models", "classical"]) == 0
    alone, together = ((tmp_path / workers / "benchmark.csv").read_bytes() for workers in ("1", "2"))
    assert together == alone


def test_trivial_answers_are_scored_on_the_slices_of_the_models(no_page, command, runs, tmp_path):
    main(command)
    with_models = values_in(tmp_path / "out")
    for path in (tmp_path / "out" / "scores" / "trivial_answers").iterdir():
        path.unlink()
    main(command)
    assert values_in(tmp_path / "out") == with_models
    assert len(runs) == 8


def test_other_weights_of_the_same_name_are_scored_anew(no_page, command, runs, monkeypatch):
    main(command)

    class Trained:
        def __init__(self, name):
            self.identity = {"sha256": f"other weights of {name}" if name == "half" else f"digest of {name}"}

    monkeypatch.setattr("evimo.benchmark.cases.model_of", Trained)
    main(command)
    assert [model for model, _ in runs[8:]] == ["half"] * 4


def test_a_changed_truth_is_scored_anew(no_page, command, runs, recordings, tmp_path):
    """As many instants, events and facts as before; the object is gone from the masks of one recording."""
    main(command)
    mask = recordings / "table" / "c" / "dataset_mask.npz"
    with np.load(mask) as maps:
        emptied = {name: np.zeros_like(maps[name]) for name in maps.files}
    np.savez_compressed(mask, **emptied)
    main(command)
    assert runs[8:] == [("half", "c"), ("perfect", "c")]
    assert ("II", "table", "perfect", "iou") not in values_in(tmp_path / "out")


def test_recordings_of_another_plan_are_refused(runs, tmp_path, capsys):
    folder = tmp_path / "out" / "recordings"
    folder.mkdir(parents=True)
    (folder / INDEX).write_text(json.dumps(BenchmarkPlan(minutes=0.5, seed=3, size=(24, 32)).index()))
    assert main(["benchmark", "--out", str(tmp_path / "out"), "--minutes", "0.5", "--size", "32x24", *MODELS]) == 2
    told = capsys.readouterr().err
    assert "recordings of another plan: seed 3 instead of seed 71000000" in told
    assert [path.name for path in folder.iterdir()] == [INDEX]
