"""A few hundred damaged files for every reader; `make fuzz` tries a hundred thousand."""

import importlib
from pathlib import Path

import numpy as np
import pytest

from evimo.errors import BadFile

ROOT = Path(__file__).parents[1]
PER_SEED = 12


@pytest.fixture
def fuzz(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(str(ROOT / "bench"))
    monkeypatch.chdir(tmp_path)
    return importlib.import_module("fuzz")


@pytest.mark.slow
def test_damaged_files_end_in_events_or_in_an_error_with_a_fix(fuzz, tmp_path):
    found = fuzz.seeds(ROOT.parent / "shared" / "data")
    faults = {}
    for number, seed in enumerate(found):
        for index in range(PER_SEED):
            if fault := fuzz.tried(seed, tmp_path / "file", np.random.default_rng((number, index))):
                faults[seed.name, index] = fault
    assert faults == {}


def test_whole_files_are_read(fuzz, tmp_path):
    """Or mutations of nothing would be tried; a pickle and YAML that would run are refused, and text of four columns
    in an order that nothing tells. Of the datasets' files the events are read, and the truth is refused, being a pickle
    that would run.
    """
    refused = set()
    for seed in fuzz.seeds(None):
        folder = tmp_path / seed.name.replace(" ", "-")
        fuzz.written(seed.files, folder)
        try:
            fuzz.read(folder / seed.opened, kind=seed.kind)
        except BadFile:
            refused.add(seed.name)
    assert {"a pickle", "YAML that runs", "EV-IMO a.npz", "EVIMO2"} <= refused
    assert not refused & {
        "text txyp",
        "EV-IMO b.npz",
        "written aedat4",
        "kalibr",
        "camera_info",
        *(
            seed.name
            for seed in fuzz.seeds(None)
            if seed.kind in ("predictions", "capture") or seed.name.startswith("truth ")
        ),
    }


@pytest.mark.parametrize(
    ("wrong", "fault"),
    [
        (lambda *_, **__: 1 / 0, "ZeroDivisionError"),
        (lambda *_, **__: np.ones(50_000_000).sum(), "MB of memory for a file of"),
        (lambda path, **_: (path.parent / "ran_what_the_file_says").touch(), "it ran what the file says"),
        (lambda *_, **__: (_ for _ in ()).throw(BadFile("no", fix="")), "without a fix"),
    ],
)
def test_what_is_wrong_is_found(fuzz, tmp_path, monkeypatch, wrong, fault):
    (tmp_path / "a.txt").write_text("1 2 3 0\n")
    assert fuzz.fault_of(tmp_path / "a.txt", tmp_path, kind="recording") is None
    monkeypatch.setattr(fuzz, "read", wrong)
    assert fault in fuzz.fault_of(tmp_path / "a.txt", tmp_path, kind="recording")


def test_the_same_index_is_the_same_file(fuzz):
    found = fuzz.seeds(None)
    once, again = (fuzz.damaged(*fuzz.drawn(found, 3, 17)) for _ in range(2))
    assert once == again
    assert fuzz.drawn(found, 3, 17)[0].files != once
