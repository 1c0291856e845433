"""EV-IMO npz: written by NumPy in the shapes and types seen in the wild, and in some that attack."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from evimo.errors import BadFile, EvimoWarning
from evimo.formats import npz_rows, open_events
from evimo.geometry.camera import Camera

MATRIX = np.array([[50.0, 0, 31], [0, 51, 23], [0, 0, 1]])
QUIET = settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def table(events, dtype):
    """Rows t x y p with p in {0, 1}; t in seconds for floats, in µs for integers."""
    t = events.t * 1e-6 if np.dtype(dtype).kind == "f" else events.t
    return np.stack([t, events.x, events.y, events.p > 0], axis=1).astype(dtype)


def save(path, stored, compressed=True, **more):
    (np.savez_compressed if compressed else np.savez)(path, events=stored, **more)
    return path


def sized(**more):
    return {"depth": np.zeros((3, 48, 64), np.uint16), **more}


@pytest.mark.parametrize("dtype", ["f4", "f8", "i8"])
@pytest.mark.parametrize("compressed", [True, False])
@pytest.mark.parametrize("order", ["C", "F"])
def test_what_was_written_is_read(tmp_path, events, rows, dtype, compressed, order):
    path = save(tmp_path / "a.npz", np.asarray(table(events, dtype), order=order), compressed, **sized())
    opened = open_events(path)
    assert (opened.sensor, opened.start_us, opened.stop_us) == ((48, 64), events.t[0], events.t[-1] + 1)
    assert rows(opened) == rows([events])
    assert rows(opened.packets(70_000, 130_000)) == rows([events.between(70_000, 130_000)])


@pytest.mark.parametrize("order", ["C", "F"])
def test_blocks_of_any_size_give_the_same(tmp_path, events, rows, monkeypatch, order):
    path = save(tmp_path / "a.npz", np.asarray(table(events, "f8"), order=order), **sized())
    monkeypatch.setattr(npz_rows, "BLOCK_ROWS", 17)
    assert rows(open_events(path)) == rows([events])
    assert rows(open_events(path).packets(70_000, 130_000)) == rows([events.between(70_000, 130_000)])


def test_named_columns_are_taken_by_name(tmp_path, events, rows):
    stored = np.zeros(len(events), [("x", "u2"), ("y", "u2"), ("t", "i8"), ("p", "i1")])
    for name in stored.dtype.names:
        stored[name] = getattr(events, name)
    assert rows(open_events(save(tmp_path / "a.npz", stored, **sized()))) == rows([events])


@QUIET
@given(
    t=st.lists(st.integers(0, 10**13), min_size=1, max_size=8).map(sorted),
    seed=st.integers(0, 99),
)
def test_microseconds_survive_seconds_in_float64(tmp_path, t, seed):
    draw = np.random.default_rng(seed)
    x, y, p = draw.integers(0, 64, len(t)), draw.integers(0, 48, len(t)), draw.integers(0, 2, len(t))
    path = save(tmp_path / "a.npz", np.stack([np.array(t) / 1e6, x, y, p], axis=1), **sized())
    (packet,) = open_events(path)
    assert packet.t.tolist() == t
    assert (packet.x.tolist(), packet.y.tolist()) == (x.tolist(), y.tolist())
    assert packet.p.tolist() == (2 * p - 1).tolist()


def test_size_comes_from_the_maps_and_camera_from_the_matrix(tmp_path, events):
    stored = table(events, "f8")
    for more in ({"depth": np.zeros((2, 260, 346))}, {"mask": np.zeros((2, 260, 346), np.uint16)}):
        opened = open_events(save(tmp_path / "a.npz", stored, K=MATRIX, **more))
        assert opened.sensor == (260, 346)
        assert opened.camera.camera == Camera(50.0, 51.0, 31.0, 23.0, 260, 346)
    with pytest.warns(EvimoWarning, match="taken as 128x128"):
        assert open_events(save(tmp_path / "a.npz", stored)).sensor == (128, 128)
    assert open_events(save(tmp_path / "a.npz", stored), sensor=(100, 200)).sensor == (100, 200)


def test_distortion_is_ignored_with_a_warning_unless_it_is_zero(tmp_path, events, recwarn):
    stored = table(events, "f8")
    open_events(save(tmp_path / "a.npz", stored, **sized(K=MATRIX, D=np.zeros(4))))
    assert not recwarn.list
    with pytest.warns(EvimoWarning, match="`D` is ignored"):
        opened = open_events(save(tmp_path / "a.npz", stored, **sized(K=MATRIX, D=np.array([0.1, 0, 0, 0]))))
    assert opened.camera.camera.distortion == ()


FACTS = {"camera": {"fx": 50, "fy": 51, "cx": 31, "cy": 23, "distortion": [0.1, 0, 0, 0], "lens": "radtan"}}


def test_the_lens_of_our_own_files_is_taken_from_their_facts(tmp_path, events, recwarn):
    told = {"sim_facts": np.array(json.dumps(FACTS)), "meta": np.array("{}")}
    wrong = {"K": 2 * MATRIX, "D": np.array([0.7, 0, 0, 0])}
    opened = open_events(save(tmp_path / "a.npz", table(events, "f8"), **sized(**told, **wrong)))
    assert not recwarn.list
    assert opened.camera.camera == Camera(50.0, 51.0, 31.0, 23.0, 48, 64, (0.1, 0.0, 0.0, 0.0), "radtan")
    assert "sim_facts" in opened.camera.source
    assert opened.contents["meta"] == "poses, as text"


@pytest.mark.parametrize(
    "facts", ["", "[]", "{}", '{"camera": {"fx": 1}}', json.dumps(FACTS).replace("50", '"wide"'), 7]
)
def test_facts_that_are_none_are_refused(tmp_path, events, facts):
    path = save(tmp_path / "a.npz", table(events, "f8"), **sized(sim_facts=np.array(facts)))
    with pytest.raises(BadFile, match="simulate it again"):
        open_events(path)


class Attack:
    """A pickle of this writes a file when it is read."""

    def __init__(self, at):
        self.at = at

    def __reduce__(self):
        return os.mkdir, (self.at,)


@pytest.fixture
def trap(tmp_path):
    """What a pickle would leave behind if its code ran."""
    at = str(tmp_path / "code_ran")
    attack = Attack(at)
    np.array([attack], dtype=object).dump(tmp_path / "proof.pkl")
    np.load(tmp_path / "proof.pkl", allow_pickle=True)  # the trap works
    os.rmdir(at)
    yield attack
    assert not Path(at).exists(), "unpickled!"


def test_pickled_events_are_refused_and_their_code_does_not_run(tmp_path, trap):
    path = save(tmp_path / "a.npz", np.array([trap, trap], dtype=object))
    with pytest.raises(BadFile, match=r"pickle.*refused"):
        open_events(path)


@pytest.mark.parametrize("name", ["K", "D", "depth", "sim_facts"])
def test_pickled_companions_are_refused_and_their_code_does_not_run(tmp_path, trap, events, name):
    path = save(tmp_path / "a.npz", table(events, "f8"), **{name: np.array([trap], dtype=object)})
    with pytest.raises(BadFile, match=r"pickle.*refused"):
        open_events(path, sensor=(48, 64) if name != "depth" else None)


def test_pickled_meta_stays_closed(tmp_path, trap, events, rows):
    path = save(tmp_path / "a.npz", table(events, "f8"), **sized(meta=np.array(trap, dtype=object)))
    opened = open_events(path)
    assert rows(opened) == rows([events]) and "not opened" in opened.contents["meta"]


def test_a_bare_pickle_is_refused_and_its_code_does_not_run(tmp_path, trap):
    np.array([trap], dtype=object).dump(tmp_path / "a.npz")
    with pytest.raises(BadFile, match="pickle, which may run code"):
        open_events(tmp_path / "a.npz")


@pytest.mark.parametrize("compressed", [True, False])
def test_a_file_that_was_cut_short_is_used_with_a_warning(tmp_path, events, rows, compressed):
    path = save(tmp_path / "a.npz", table(events, "f8"), compressed)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.warns(EvimoWarning, match=r"cut short: \d+ of 1,000 events are readable"):
        seen = rows(open_events(path, sensor=(48, 64)))
    assert 300 < len(seen) < 700 and seen == rows([events])[: len(seen)]


def test_events_behind_other_arrays_are_found_in_a_cut_file(tmp_path, events, rows):
    path = tmp_path / "a.npz"
    np.savez(path, K=MATRIX, events=table(events, "f8"))
    path.write_bytes(path.read_bytes()[:-1000])
    with pytest.warns(EvimoWarning, match="cut short"):
        opened = open_events(path, sensor=(48, 64))
    seen = rows(opened)
    assert len(seen) > 900 and seen == rows([events])[: len(seen)]
    assert opened.camera.camera.fx == 50


def test_nothing_readable_is_an_error(tmp_path, events):
    path = save(tmp_path / "a.npz", table(events, "f8"))
    path.write_bytes(path.read_bytes()[:60])
    with pytest.raises(BadFile):
        open_events(path)


@pytest.mark.parametrize(
    "stored, words",
    [
        (np.zeros((0, 4)), "holds no events"),
        (np.zeros((5, 3)), r"shape \(5, 3\)"),
        (np.zeros((5, 4), complex), "complex128"),
    ],
)
def test_what_cannot_be_read_is_said(tmp_path, stored, words):
    with pytest.raises(BadFile, match=words):
        open_events(save(tmp_path / "a.npz", stored))


def test_an_archive_without_events_says_what_it_holds(tmp_path):
    np.savez(tmp_path / "a.npz", depth=np.zeros(3), mask=np.zeros(3))
    with pytest.raises(BadFile, match="only depth, mask"):
        open_events(tmp_path / "a.npz")


def test_impossible_pixels_are_dropped_and_counted(tmp_path):
    stored = np.array([[0, 1, 2, 1], [1e-6, -1, 2, 1], [2e-6, 1, 1e9, 0], [3e-6, 3, 4, 0]])
    opened = open_events(save(tmp_path / "a.npz", stored), sensor=(48, 64))
    with pytest.warns(EvimoWarning, match="2 events outside"):
        assert sum(map(len, opened)) == 2


@pytest.mark.parametrize("column", range(4))
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_value_that_is_no_number_costs_one_event(tmp_path, events, rows, column, value):
    stored = table(events, "f8")
    stored[500, column] = value
    opened = open_events(save(tmp_path / "a.npz", stored), sensor=(48, 64))
    if column == 3 and not np.isnan(value):
        assert sum(map(len, opened)) == 1000
        return
    with pytest.warns(EvimoWarning, match="1 events"):
        assert rows(opened) == rows([events.part(0, 500), events.part(501, 1000)])


@pytest.mark.parametrize("fields", ["txyp", "four arrays"])
def test_four_arrays_are_read_as_one(tmp_path, events, rows, fields):
    columns = {name: getattr(events, name) for name in "txyp"}
    np.savez(
        tmp_path / "a.npz",
        **(columns if fields == "txyp" else {"ts": events.t, "xs": events.x, "ys": events.y, "pol": events.p > 0}),
    )
    assert rows(open_events(tmp_path / "a.npz", sensor=(48, 64))) == rows([events])


@pytest.mark.parametrize("order", ["xytp", "xypt", "txyp", "ptxy"])
@pytest.mark.parametrize("said", [False, True])
def test_the_order_of_columns_is_found_or_said(tmp_path, events, rows, order, said):
    stored = np.stack([np.asarray(getattr(events, letter), np.float64) for letter in order], axis=1)
    path = save(tmp_path / "a.npz", stored)
    opened = open_events(path, sensor=(48, 64), time_unit="us", columns=order if said else None)
    assert rows(opened) == rows([events])
