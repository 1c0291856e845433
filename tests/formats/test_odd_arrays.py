"""Arrays whose columns are not what they seem: refused or said, never read wrong."""

import h5py
import numpy as np
import pytest

from evimo.errors import BadFile
from evimo.events.events import joined
from evimo.formats import open_events

SIZE = (48, 64)


def columns_of(events):
    return {"t": events.t, "x": events.x, "y": events.y, "p": (events.p > 0).astype(np.uint8)}


def saved(path, columns, **beside):
    if path.suffix == ".npz":
        np.savez(path, **columns)
    elif path.suffix == ".h5":
        with h5py.File(path, "w") as file:
            for name, column in columns.items():
                file[f"events/{name}"] = column
            for name, value in beside.items():
                file[name] = value
    else:
        path.mkdir()
        np.save(path / "dataset_events_t.npy", columns["t"])
        np.save(path / "dataset_events_xy.npy", np.stack((columns["x"], columns["y"]), axis=1))
        np.save(path / "dataset_events_p.npy", columns["p"])
    return path


@pytest.mark.parametrize("name", ["a.npz", "a.h5", "folder"])
def test_polarities_of_one_and_two_are_refused_as_all_would_be_brighter(tmp_path, events, rows, name):
    columns = columns_of(events)
    path = saved(tmp_path / name, columns | {"p": columns["p"] + 1})
    with pytest.raises(BadFile, match="its polarities are 1 and 2"):
        open_events(path, sensor=SIZE, time_unit="us")
    path = saved(tmp_path / f"again{name}", columns | {"p": columns["p"] * 255})
    assert rows(open_events(path, sensor=SIZE, time_unit="us")) == rows([events])


@pytest.mark.parametrize("name", ["a.npz", "a.h5", "folder"])
def test_arrays_of_unequal_length_are_refused_as_nothing_tells_what_belongs_together(tmp_path, events, name):
    columns = columns_of(events)
    path = saved(tmp_path / name, columns | {"p": columns["p"][:-3]})
    with pytest.raises(BadFile, match=r"unequal length \(.*1,000.* 997\).*\n  try: copy all of them again"):
        open_events(path, sensor=SIZE)


@pytest.mark.parametrize("index", [10**9, 900, -5])
def test_an_index_of_another_file_is_not_used(tmp_path, events, index):
    path = saved(tmp_path / "a.h5", columns_of(events), ms_to_idx=np.full(500, index))
    found = joined(list(open_events(path, sensor=SIZE).packets(100_000)))
    assert found.t.tolist() == events.t[events.t >= 100_000].tolist()


def test_an_index_that_fits_is_used(tmp_path, events):
    path = saved(tmp_path / "a.h5", columns_of(events), ms_to_idx=np.searchsorted(events.t, np.arange(200) * 1000))
    first = next(open_events(path, sensor=SIZE).read(150_000))
    assert 99_000 <= first.t[0] <= 101_500  # 50 ms sooner, for what is out of order


def test_the_size_in_files_of_event_to_video(tmp_path, events):
    path = saved(tmp_path / "a.h5", columns_of(events))
    with h5py.File(path, "a") as file:
        file.attrs["sensor_resolution"] = SIZE
    assert open_events(path).sensor == SIZE


def test_times_in_no_order_are_refused_and_frames_that_are_sorted_by_pixel_are_not(tmp_path, some_events, rows):
    events = some_events(20_000, span_us=1_000_000)
    columns = columns_of(events)
    mixed = np.random.default_rng(0).permutation(len(events))
    path = saved(tmp_path / "a.h5", {name: column[mixed] for name, column in columns.items()})
    with pytest.raises(BadFile, match="its times are in no order"):
        open_events(path, sensor=SIZE)
    for frame_us, name in ((10_000, "b.h5"), (40_000, "c.h5")):
        order = np.lexsort((events.x, events.y, events.t // frame_us))
        path = saved(tmp_path / name, {name: column[order] for name, column in columns.items()})
        assert sorted(rows(open_events(path, sensor=SIZE))) == sorted(rows([events]))
    short = np.flatnonzero(events.t < 40_000)
    order = short[np.lexsort((events.x[short], events.y[short]))]
    path = saved(tmp_path / "d.h5", {name: column[order] for name, column in columns.items()})
    assert sum(map(len, open_events(path, sensor=SIZE))) == len(short)


def test_seconds_beside_nanoseconds_are_refused(tmp_path, events):
    rows = np.stack((events.t // 50_000 + 1_650_000_000, events.t % 50_000, events.x, events.y, events.p > 0), axis=1)
    np.savez(tmp_path / "a.npz", events=rows)
    with pytest.raises(BadFile, match="times in two columns"):
        open_events(tmp_path / "a.npz", sensor=SIZE)
