"""AEDAT 4 by our reader; RAW by a decoder written here from Prophesee's documentation, tried on a real file first."""

import hashlib
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evimo.errors import BadInput, MissingExtra
from evimo.events.events import Events, joined, no_events
from evimo.formats import open_events, saving
from evimo.formats.saving import check_events_format, save_events


def some_events(count=1000, *, span_us=400_000, size=(48, 64)):
    draw = np.random.default_rng(1)
    t = np.sort(draw.integers(0, span_us, count))
    x, y = draw.integers(0, size[1], count), draw.integers(0, size[0], count)
    return Events(x.astype(np.uint16), y.astype(np.uint16), t, draw.choice([-1, 1], count).astype(np.int8))


def in_packets(events, *cuts):
    return [events.part(first, last) for first, last in zip((0, *cuts), (*cuts, len(events)), strict=True)]


def same(one, two):
    return all(np.array_equal(getattr(one, name), getattr(two, name)) for name in "xytp")


def decoded(raw):
    """Size and events of an EVT 2.0 RAW file, word by word."""
    header, lines = {}, 0
    while raw.startswith(b"% ", lines):
        end = raw.index(b"\n", lines)
        key, _, value = raw[lines + 2 : end].decode().partition(" ")
        header[key], lines = value, end + 1
        if key == "end":
            break
    assert header["evt"] == "2.0"
    rows, high, wraps = [], None, 0
    for word in np.frombuffer(raw, "<u4", offset=lines).tolist():
        kind = word >> 28
        if kind == 0b1000:
            wraps += high is not None and word & 0x0FFFFFFF < high
            high = word & 0x0FFFFFFF
        elif kind <= 1:
            time = (wraps << 34) + (high << 6) + (word >> 22 & 0x3F)
            rows.append((word >> 11 & 0x7FF, word & 0x7FF, time, 1 if kind else -1))
    x, y, t, p = np.array(rows, np.int64).reshape(-1, 4).T
    return header, Events(x.astype(np.uint16), y.astype(np.uint16), t, p.astype(np.int8))


def test_the_decoder_of_this_test_reads_a_real_recording(shared_data):
    _, events = decoded(shared_data("formats/prophesee/evt2.raw").read_bytes())
    assert len(events) == 521_252
    digests = shared_data("formats/expected_digests.csv").read_text()
    for column in (events.x, events.y, events.p > 0):
        assert hashlib.sha3_224(column.tobytes()).hexdigest() in digests


def test_raw_is_decoded_to_what_was_written(tmp_path):
    events = some_events()
    save_events(in_packets(events, 1, 1, 500), tmp_path / "a.raw", size=(48, 64))
    header, read = decoded((tmp_path / "a.raw").read_bytes())
    assert same(read, events)
    assert header["geometry"] == "64x48"
    assert header["format"] == "EVT2;height=48;width=64"
    assert [file.name for file in tmp_path.iterdir()] == ["a.raw"]


@given(waits=st.lists(st.integers(0, 2**33), min_size=1, max_size=30), cut=st.integers(0, 30))
def test_raw_keeps_any_time(waits, cut, tmp_path_factory):
    t = np.cumsum(waits)
    corner = np.arange(len(t)) % 2 * 2047
    events = Events(corner.astype(np.uint16), corner.astype(np.uint16), t, np.where(corner, 1, -1).astype(np.int8))
    path = tmp_path_factory.mktemp("raw") / "a.raw"
    save_events(in_packets(events, min(cut, len(t))), path, size=(2048, 2048))
    read = decoded(path.read_bytes())[1]
    lost = read.t[0] - t[0]  # the first time may have started over before anything was there to compare with
    assert lost % 2**34 == 0
    assert (read.t - lost).tolist() == t.tolist()
    assert read.x.tolist() == corner.tolist()


def test_aedat4_is_read_back(tmp_path):
    events = some_events(25_000)  # more than one packet of the file
    save_events(in_packets(events, 10, 11_000), tmp_path / "a.aedat4", size=(48, 64))
    opened = open_events(tmp_path / "a.aedat4")
    assert opened.sensor == (48, 64)
    assert same(joined(list(opened)), events)
    assert same(joined(list(opened.packets(100_000, 110_000))), events.between(100_000, 110_000))


@pytest.mark.parametrize("name", ["a.raw", "a.aedat4"])
def test_no_events_are_a_file_too(tmp_path, name):
    save_events([no_events()], tmp_path / name, size=(48, 64))
    assert (tmp_path / name).stat().st_size > 40


@pytest.mark.parametrize("name", ["a.raw", "a.aedat4"])
def test_what_breaks_off_leaves_nothing(tmp_path, name):
    def broken():
        yield some_events()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        save_events(broken(), tmp_path / name, size=(48, 64))
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_written_is_said_first(monkeypatch):
    with pytest.raises(BadInput, match="one of aedat4, raw"):
        check_events_format("dat", (48, 64))
    with pytest.raises(BadInput, match="2048"):
        check_events_format("raw", (48, 4096))
    monkeypatch.setitem(sys.modules, "dv_processing", None)
    with pytest.raises(MissingExtra, match=r"\[formats\]"):
        check_events_format("aedat4", (48, 64))
    check_events_format("raw", (48, 64))
    assert set(saving.SAVE) == {"aedat4", "raw"}
