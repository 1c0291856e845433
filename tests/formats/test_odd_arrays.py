"""Arrays whose columns are not what they seem: refused or said, never read wrong."""

import zipfile

import h5py
import numpy as np
import pytest

from evimo.errors import BadFile, BadInput, EvimoWarning
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


def test_the_order_of_axes_of_four_arrays_does_not_matter(tmp_path, events, rows):
    """As MATLAB's columns come: (1, N) and (N, 1)."""
    for number, axis in enumerate((0, 1)):
        columns = {name: np.expand_dims(column, axis) for name, column in columns_of(events).items()}
        for suffix in ("npz", "h5"):
            path = saved(tmp_path / f"{number}.{suffix}", columns)
            opened = open_events(path, sensor=SIZE)
            assert rows(opened) == rows([events]), path
            assert rows(opened.packets(100_000, 150_000)) == rows([events.between(100_000, 150_000)])


@pytest.mark.parametrize("column", [np.zeros((1000, 2)), np.full(1000, "on"), np.zeros(1000, complex)])
def test_columns_that_are_none_are_refused(tmp_path, events, column):
    path = saved(tmp_path / "a.npz", columns_of(events) | {"p": column})
    with pytest.raises(BadFile, match=r"`p` in a\.npz (has shape|is of)"):
        open_events(path, sensor=SIZE)
    with pytest.raises(BadFile):
        open_events(saved(tmp_path / "folder", columns_of(events) | {"p": column}), sensor=SIZE)


@pytest.mark.parametrize("suffix", ["npz", "h5", "csv"])
def test_the_flow_of_each_event_is_not_its_place(tmp_path, events, rows, suffix):
    flow = np.random.default_rng(0).normal(size=(2, len(events)))
    columns = {"t": events.t, "u": flow[0], "v": flow[1]} | columns_of(events)
    if suffix == "csv":
        table = np.stack(list(columns.values()), axis=1)
        np.savetxt(tmp_path / "a.csv", table, "%.9g", delimiter=",", header=",".join(columns), comments="")
    else:
        saved(tmp_path / f"a.{suffix}", columns)
    assert rows(open_events(tmp_path / f"a.{suffix}", sensor=SIZE)) == rows([events])


def test_fields_beside_those_of_events_may_be_words(tmp_path, events, rows):
    table = np.zeros(len(events), [("t", "i8"), ("x", "u2"), ("y", "u2"), ("p", "i1"), ("label", "S8")])
    for name, column in columns_of(events).items():
        table[name] = column
    np.savez(tmp_path / "a.npz", events=table)
    assert rows(open_events(tmp_path / "a.npz", sensor=SIZE)) == rows([events])


@pytest.mark.parametrize("name", ["a.npz", "a.h5", "folder"])
def test_pixels_with_fractions_are_said_and_parts_of_an_image_refused(tmp_path, events, name):
    columns = columns_of(events)
    path = saved(tmp_path / name, columns | {"x": columns["x"] + np.float32(0.25), "y": columns["y"].astype("f4")})
    with pytest.warns(EvimoWarning, match="its events lie between pixels and are rounded"):
        assert joined(list(open_events(path, sensor=SIZE))).x.tolist() == events.x.tolist()
    path = saved(tmp_path / f"again{name}", columns | {"x": columns["x"] / 64, "y": columns["y"] / 48})
    with pytest.raises(BadFile, match=r"its pixels, such as .*, are parts of an image\n  try: multiply"):
        open_events(path, sensor=SIZE)


def test_text_with_parts_of_an_image_is_refused(tmp_path, events):
    table = np.stack((events.t, events.x / 64, events.y / 48, events.p > 0), axis=1)
    np.savetxt(tmp_path / "a.txt", table, fmt=["%d", "%.6f", "%.6f", "%d"])
    with pytest.raises(BadFile, match="are parts of an image"):
        open_events(tmp_path / "a.txt", sensor=SIZE)


def test_a_packed_folder_of_evimo2_is_called_that(tmp_path, events):
    with zipfile.ZipFile(tmp_path / "scene.zip", "w") as archive:
        for path in saved(tmp_path / "folder", columns_of(events)).iterdir():
            archive.write(path, f"scene/{path.name}")
    with pytest.raises(BadFile, match="try: unpack it, and give the folder"):
        open_events(tmp_path / "scene.zip")


@pytest.mark.parametrize(
    ("offset", "kind", "expected_us"),
    [
        (60_000.25, 1e-6, 60_000_250_000),
        (60_000.5, 1e-3, 60_000_500),
        (np.array([7_000_000]), 1, 7_000_000),
        ("sixty", 1, 0),
    ],
)
def test_offsets_of_all_kinds_are_added(tmp_path, some_events, offset, kind, expected_us):
    events = some_events(20_000, span_us=1_000_000)
    t = events.t * kind if kind != 1 else events.t
    path = saved(tmp_path / "a.h5", columns_of(events) | {"t": t}, t_offset=offset, ms_to_idx="none")
    assert joined(list(open_events(path, sensor=SIZE))).t.tolist() == (events.t + expected_us).tolist()


@pytest.mark.parametrize("place", ["/", "events"])
def test_an_offset_may_be_an_attribute(tmp_path, events, place):
    path = saved(tmp_path / "a.h5", columns_of(events))
    with h5py.File(path, "a") as file:
        file[place].attrs["t_offset"] = np.uint64(7_000_000)
    assert joined(list(open_events(path, sensor=SIZE))).t.tolist() == (events.t + 7_000_000).tolist()


@pytest.mark.parametrize(("kind", "offset"), [(1, 7_000_000), (1e-6, 7.0)])
def test_the_offset_of_an_archive_is_added(tmp_path, some_events, kind, offset):
    events = some_events(20_000, span_us=1_000_000)
    path = tmp_path / "a.npz"
    np.savez(path, **columns_of(events) | {"t": events.t * kind}, t_offset=offset)
    recording = open_events(path, sensor=SIZE)
    assert joined(list(recording)).t.tolist() == (events.t + 7_000_000).tolist()
    assert next(recording.packets(7_500_000)).t[0] >= 7_500_000
    np.savez(path, **columns_of(events), t_offset="seven")
    with pytest.raises(BadFile, match=r"its t_offset .* is no number"):
        open_events(path, sensor=SIZE)


def test_an_offset_that_is_no_number_is_named(tmp_path, events):
    with pytest.raises(BadFile, match="its t_offset nan is no number"):
        open_events(saved(tmp_path / "a.h5", columns_of(events), t_offset=np.nan), sensor=SIZE)


@pytest.mark.parametrize("index", [np.full(500, np.nan), np.zeros((500, 2), int), np.int64(5)])
def test_an_index_of_another_kind_is_not_used(tmp_path, events, index):
    path = saved(tmp_path / "a.h5", columns_of(events), ms_to_idx=index)
    found = joined(list(open_events(path, sensor=SIZE).packets(100_000)))
    assert found.t.tolist() == events.t[events.t >= 100_000].tolist()


@pytest.mark.parametrize(
    "attributes",
    [
        *({"geometry": value} for value in ("desk", "0x0", "64")),
        *({"width": side, "height": 48} for side in (0, -64, np.nan, 10**6)),
        {"sensor_resolution": [0, 0]},
    ],
)
def test_sizes_that_are_none_are_named(tmp_path, events, rows, attributes):
    path = saved(tmp_path / "a.h5", columns_of(events))
    with h5py.File(path, "a") as file:
        file.attrs.update(attributes)
    with pytest.raises(BadFile, match=r"a\.h5: its .* is no sensor size\n  try: give it with --sensor"):
        open_events(path)
    assert rows(open_events(path, sensor=SIZE)) == rows([events])


@pytest.mark.parametrize(
    "sides", [(48, 64), (np.array([48]), np.array([64])), (np.array([[48.0]]), np.array([[64.0]]))]
)
@pytest.mark.parametrize("name", ["attributes.h5", "arrays.h5", "a.npz"])
def test_sides_of_the_sensor_are_numbers_or_arrays_of_one(tmp_path, events, name, sides):
    told = dict(zip(("height", "width"), sides, strict=True))
    if name == "a.npz":
        np.savez(tmp_path / name, **columns_of(events), **told)
    elif name == "arrays.h5":
        saved(tmp_path / name, columns_of(events), **told)
    else:
        with h5py.File(saved(tmp_path / name, columns_of(events)), "a") as file:
            file.attrs.update(told)
    assert open_events(tmp_path / name).sensor == SIZE


def test_sides_that_are_swapped_are_turned_and_said(tmp_path, events, rows):
    path = saved(tmp_path / "a.h5", columns_of(events))
    with h5py.File(path, "a") as file:
        file.attrs["sensor_resolution"] = SIZE[::-1]
    with pytest.warns(EvimoWarning, match="tells a sensor of 48x64, and its events fit only one of 64x48"):
        assert rows(open_events(path)) == rows([events])


def test_the_one_array_of_an_archive_is_its_events_by_any_name(tmp_path, events, rows):
    columns = columns_of(events)
    table = np.stack(list(columns.values()), axis=1)
    np.savez(tmp_path / "a.npz", table)
    fields = np.zeros(len(events), [(name, np.int64) for name in columns])
    for name, column in columns.items():
        fields[name] = column
    np.savez(tmp_path / "b.npz", event_stream=fields)
    for name in ("a.npz", "b.npz"):
        assert rows(open_events(tmp_path / name, sensor=SIZE)) == rows([events])
    np.savez(tmp_path / "c.npz", table, table)
    with pytest.raises(BadFile, match="holds no array `events`, only arr_0, arr_1"):
        open_events(tmp_path / "c.npz")


def test_of_many_tables_few_are_listed(tmp_path, events):
    path = saved(tmp_path / "a.h5", columns_of(events))
    with h5py.File(path, "a") as file:
        for number in range(30):
            file.copy("events", f"packet{number}")
    with pytest.warns(EvimoWarning, match=r"and 23 others; .* is read"):
        assert open_events(path, sensor=SIZE).contents["topics"].endswith("and 23 others")


def test_what_else_a_file_holds_does_not_stand_in_the_way(tmp_path, events, rows):
    """Another camera's arrays of unequal length, and an array that is called events and holds none."""
    path = saved(tmp_path / "a.h5", columns_of(events))
    with h5py.File(path, "a") as file:
        for number, name in enumerate("txyp"):
            file[f"right/{name}"] = np.zeros(5 + number)
        file["left_events"] = np.random.default_rng(0).random((50, 4))
    assert rows(open_events(path, sensor=SIZE)) == rows([events])
    with pytest.raises(BadFile, match="unequal length"):
        open_events(path, sensor=SIZE, topic="right")


def test_more_columns_than_four_are_told_apart(tmp_path, events, rows):
    table = np.stack((events.x, events.y, events.t * 1e-6, events.p, np.arange(1000) % 7), axis=1)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["davis/events"] = table
    for columns in (None, "xytp_"):
        assert rows(open_events(tmp_path / "a.h5", sensor=SIZE, columns=columns)) == rows([events])
    np.savez(tmp_path / "a.npz", events=table)
    for name in ("a.h5", "a.npz"):
        with pytest.raises(BadInput, match="names 6 columns, and there are 5"):
            open_events(tmp_path / name, sensor=SIZE, columns="__xytp")
