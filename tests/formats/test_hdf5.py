"""HDF5 in the layouts of public datasets, written with h5py itself."""

import h5py
import numpy as np
import pytest

from evimo.errors import BadFile, EvimoWarning, NotFound
from evimo.events.events import joined, no_events
from evimo.formats import hdf5, open_events

SIZE = (48, 64)


def dsec(file, events, offset=7_000_000_000):
    """DSEC and TUM-VIE: arrays in a group, an index of milliseconds and an offset beside it."""
    group = file.create_group("events")
    for name, kind in (("x", "u2"), ("y", "u2"), ("t", "u4"), ("p", "u1")):
        group[name] = (np.maximum(events.p, 0) if name == "p" else getattr(events, name)).astype(kind)
    file["t_offset"] = offset
    file["ms_to_idx"] = np.searchsorted(events.t, np.arange(0, events.t[-1] // 1000 + 1) * 1000)


def mvsec(file, events, side="left"):
    """MVSEC: rows x y t p of float64 seconds."""
    columns = events.x, events.y, 1_500_000_000 + events.t * 1e-6, events.p
    file[f"davis/{side}/events"] = np.stack(columns, axis=1)


def prophesee(file, events):
    """Metavision: an array of fields, the size as an attribute."""
    rows = np.zeros(len(events), [("x", "u2"), ("y", "u2"), ("p", "i2"), ("t", "i8")])
    for name in "xyt":
        rows[name] = getattr(events, name)
    rows["p"] = events.p > 0
    file.create_group("CD")["events"] = rows
    file.attrs["geometry"] = "64x48"


def m3ed(file, events):
    group = file.create_group("prophesee/left")
    for name in "xytp":
        group[name] = getattr(events, name)
    group["ms_map_idx"] = np.searchsorted(events.t, np.arange(0, events.t[-1] // 1000 + 1) * 1000)
    group["calib/resolution"] = (64, 48)


def v2e(file, events):
    file["events"] = np.stack([events.t, events.x, events.y, events.p > 0], axis=1).astype(np.uint32)


@pytest.fixture
def made(tmp_path):
    def make(write, *arguments):
        path = tmp_path / f"{len(list(tmp_path.iterdir()))}.h5"
        with h5py.File(path, "w") as file:
            write(file, *arguments)
        return path

    return make


@pytest.mark.parametrize("write, shift", [(dsec, 7_000_000_000), (mvsec, 1_500_000_000_000_000), (v2e, 0)])
def test_layouts_without_a_size_are_read(made, events, rows, write, shift):
    opened = open_events(made(write, events), sensor=SIZE)
    assert (opened.start_us, opened.stop_us) == (events.t[0] + shift, events.t[-1] + 1 + shift)
    assert [(x, y, t - shift, p) for x, y, t, p in rows(opened)] == rows([events])


@pytest.mark.parametrize("write", [prophesee, m3ed])
def test_layouts_with_a_size_are_read(made, events, rows, write):
    opened = open_events(made(write, events))
    assert opened.sensor == SIZE and rows(opened) == rows([events])


@pytest.mark.parametrize("write", [dsec, mvsec, m3ed])
def test_seeking_finds_what_reading_everything_finds(made, some_events, monkeypatch, write):
    monkeypatch.setattr(hdf5, "PACKET_EVENTS", 1000)
    opened = open_events(made(write, some_events(30_000, span_us=900_000)), sensor=SIZE)
    everything = joined(list(opened))
    for start in (0, 1, 30_000, 333_333, 899_000):
        window = opened.start_us + start, opened.start_us + start + 70_000
        assert joined(list(opened.packets(*window))).t.tolist() == everything.between(*window).t.tolist()


def test_seeking_reads_little(made, some_events, monkeypatch):
    monkeypatch.setattr(hdf5, "PACKET_EVENTS", 1000)
    for write in (dsec, mvsec):
        opened = open_events(made(write, some_events(30_000, span_us=900_000)), sensor=SIZE)
        first = next(opened.read(opened.start_us + 800_000))
        assert first.t[0] > opened.start_us + 700_000


def test_several_cameras_are_said_and_chosen(made, events, rows, some_events):
    def both(file):
        mvsec(file, events, "left")
        mvsec(file, some_events(500, seed=1), "right")

    path = made(both)
    with pytest.warns(EvimoWarning, match="several cameras: davis/left/events, davis/right/events"):
        opened = open_events(path, sensor=SIZE)
    assert "davis/right/events (500 events)" in opened.contents["topics"] and sum(map(len, opened)) == 1000
    for topic in ("right", "davis/right/events", "/davis/right/events"):
        assert sum(map(len, open_events(path, sensor=SIZE, topic=topic))) == 500
        assert open_events(path, sensor=SIZE, topic=topic).topic == "davis/right/events"
    with pytest.raises(NotFound, match="--topic up\n  try: one of: davis/left/events, davis/right/events"):
        open_events(path, topic="up")
    with pytest.raises(NotFound, match=r"2 events in 0\.h5 fit --topic davis"):
        open_events(path, topic="davis")


def test_seconds_and_nanoseconds_where_microseconds_are_usual(made, some_events):
    events = some_events(20_000, span_us=4_000_000)

    def nanoseconds(file):
        for name, column in (("ts", events.t * 1000), ("xs", events.x), ("ys", events.y), ("ps", events.p > 0)):
            file[f"events/{name}"] = column

    with pytest.warns(EvimoWarning, match="times are taken as ns"):
        opened = open_events(made(nanoseconds), sensor=SIZE)
    assert joined(list(opened)).t.tolist() == events.t.tolist()
    assert open_events(made(nanoseconds), sensor=SIZE, time_unit="us").stop_us == events.t[-1] * 1000 + 1


def test_a_codec_that_is_not_there_is_named(made, events):
    def ecf(file):
        prophesee(file, events)
        rows = file["CD/events"][:]
        del file["CD/events"]
        plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plan.set_chunk((100,))
        plan.set_filter(36559, h5py.h5z.FLAG_OPTIONAL, ())
        space = h5py.h5s.create_simple(rows.shape)
        array = h5py.h5d.create(file["CD"].id, b"events", h5py.h5t.py_create(rows.dtype), space, plan)
        array.write(h5py.h5s.ALL, h5py.h5s.ALL, rows)

    with pytest.raises(BadFile, match="Prophesee's ECF codec, which is not installed\n  try: set HDF5_PLUGIN_PATH"):
        open_events(made(ecf))


def test_blosc_is_read(made, events, rows):
    plugin = pytest.importorskip("hdf5plugin")

    def packed(file):
        dsec(file, events, 0)
        for name in "xytp":
            column = file[f"events/{name}"][:]
            del file[f"events/{name}"]
            file.create_dataset(f"events/{name}", data=column, chunks=(100,), **plugin.Blosc())

    assert rows(open_events(made(packed), sensor=SIZE)) == rows([events])


@pytest.mark.parametrize(
    "content, words",
    [
        (lambda file: None, "HDF5 without events: it is empty"),
        (lambda file: file.create_dataset("depth", data=np.zeros((3, 4))), "HDF5 without events: depth"),
        (lambda file: v2e(file, no_events()), "HDF5 without events: events"),
        (lambda file: prophesee(file, no_events()), "holds no events"),
    ],
)
def test_what_holds_no_events_is_said(made, content, words):
    with pytest.raises(BadFile, match=words):
        open_events(made(content))


def test_a_file_cut_short_is_one_error(made, some_events):
    path = made(dsec, some_events(50_000))
    whole = path.read_bytes()
    for share in (0.01, 0.3, 0.9):
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(BadFile, match=r"0\.h5"):
            list(open_events(path, sensor=SIZE))


def test_a_clock_that_starts_again_is_cut_and_seen_when_opening(made, some_events, rows):
    first, second = some_events(30_000, span_us=900_000), some_events(9_000, seed=1, span_us=300_000)
    opened = open_events(made(dsec, joined([first, second]), 0), sensor=SIZE)
    assert opened.stop_us == first.t[-1] + 1
    with pytest.warns(EvimoWarning, match="the 9,000 events from there on were dropped"):
        assert rows(opened) == rows([first])


def test_real_files_hold_the_same_events_as_the_bag(shared_data):
    bag = joined(list(open_events(shared_data("formats/ros/davis346_1s_dvs_msgs.bag"))))
    for style in ("dsec", "mvsec"):
        opened = open_events(shared_data(f"formats/hdf5/davis346_1s_{style}_style.h5"), sensor=(260, 346))
        events = joined(list(opened))
        for name in "xytp":
            assert np.array_equal(getattr(events, name), getattr(bag, name)), (style, name)
