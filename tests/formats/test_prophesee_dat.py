"""Prophesee DAT, against records packed one by one from its documentation."""

import struct

import numpy as np
import pytest

from evimo.errors import BadFile, EvimoWarning
from evimo.events.events import Events, joined
from evimo.formats import open_events, word_file
from evimo.formats.event_record_kernel import decode_dat

HEAD = b"% Data file containing CD events.\n% Version 2\n% Date 2017-10-31 11:29:21\n% Height 48\n% Width 64\n"


def record(x, y, t, p, *, version=2):
    columns, rows, sign = {1: (9, 8, 17), 2: (14, 14, 28)}[version]
    assert x < 1 << columns and y < 1 << rows
    return struct.pack("<II", t % 2**32, x | y << columns | (p > 0) << sign)


def written(path, events, *, head=HEAD, kind=b"\x0c\x08", version=2, end=b""):
    columns = (column.tolist() for column in (events.x, events.y, events.t, events.p))
    records = [record(*event, version=version) for event in zip(*columns, strict=True)]
    path.write_bytes(head + kind + b"".join(records) + end)
    return path


@pytest.mark.parametrize("block", [8, 100, 1 << 19])
def test_what_was_written_is_read(tmp_path, events, rows, monkeypatch, block):
    monkeypatch.setattr(word_file, "BLOCK_BYTES", block)
    opened = open_events(written(tmp_path / "a.dat", events))
    assert (opened.sensor, opened.start_us, opened.stop_us) == ((48, 64), events.t[0], events.t[-1] + 1)
    assert rows(opened) == rows([events])
    assert rows(opened.packets(70_000, 130_000)) == rows([events.between(70_000, 130_000)])


def test_version_1_has_narrower_columns_and_rows(tmp_path, events, rows):
    head = b"% Data file containing TD events.\n% Version 1\n% Width 64\n% Height 48\n"
    opened = open_events(written(tmp_path / "a.dat", events, head=head, kind=b"\0\x08", version=1))
    assert rows(opened) == rows([events]) and opened.format == "Prophesee DAT 1"


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("line", [b"", b"% Version {}.0\n"])
def test_a_header_without_a_version_leaves_it_to_the_bits(tmp_path, events, rows, version, line):
    head = b"% Data file containing CD events.\n% Width 64\n% Height 48\n" + line.replace(b"{}", b"%d" % version)
    opened = open_events(written(tmp_path / "a.dat", events, head=head, version=version, end=b"123"))
    assert rows(opened) == rows([events]) and opened.format == f"Prophesee DAT {version}"


def test_times_go_on_where_their_bits_wrap(tmp_path, events):
    late = Events(events.x, events.y, events.t + 2**32 - 100_000, events.p)
    opened = open_events(written(tmp_path / "a.dat", late))
    assert joined(list(opened)).t.tolist() == late.t.tolist()


def test_a_header_without_a_size_lets_it_be_guessed(tmp_path, events, rows):
    head = b"% Data file containing N9Chronocam7Event2dE events.\n% Version 2\n% Date 2017-10-31 11:29:21\n"
    with pytest.warns(EvimoWarning, match="taken as 128x128"):
        opened = open_events(written(tmp_path / "a.dat", events, head=head, kind=b"\0\x08"))
    assert rows(opened) == rows([events])


def test_a_file_cut_inside_an_event_is_read_with_a_warning(tmp_path, events, rows):
    with pytest.warns(EvimoWarning, match="its last 5 bytes are left out"):
        opened = open_events(written(tmp_path / "a.dat", events, end=b"12345"))
    assert rows(opened) == rows([events])


@pytest.mark.parametrize(
    "change, message",
    [
        ({"kind": b"\x0e\x08"}, "events of another kind .triggers"),
        ({"kind": b"\x0c\x10"}, "events of another kind"),
        ({"head": HEAD.replace(b"Version 2", b"Version 3")}, "DAT version 3; 1 and 2 are read"),
        ({"kind": b""}, None),
    ],
)
def test_what_cannot_be_read_is_said(tmp_path, events, change, message):
    with pytest.raises(BadFile, match=message):
        open_events(written(tmp_path / "a.dat", events if message else events.part(0, 0), **change))


def test_without_events_it_says_so(tmp_path, events):
    with pytest.raises(BadFile, match="holds no events"):
        open_events(written(tmp_path / "a.dat", events.part(0, 0)))


def test_a_real_file(shared_data):
    """N-CARS; each of its records by hand."""
    path = shared_data("formats/prophesee/sample_ncars.dat")
    raw = path.read_bytes()
    stored = [struct.unpack_from("<II", raw, at) for at in range(len(raw) - 2009 * 8, len(raw), 8)]
    with pytest.warns(EvimoWarning, match="sensor's size"):
        events = joined(list(open_events(path)))
    assert events.t.tolist() == [t for t, _ in stored]
    assert events.x.tolist() == [a & 0x3FFF for _, a in stored]
    assert events.y.tolist() == [a >> 14 & 0x3FFF for _, a in stored]
    assert np.array_equal(events.p > 0, [a >> 28 == 1 for _, a in stored])


@pytest.mark.parametrize("wrong", [None, 0xFFFFFFFF, 0x90000000, 0x7FFFFFFF, 0])
@pytest.mark.parametrize("since_us", [0, 2**31 - 100_000, 2**32 - 100_000])
@pytest.mark.parametrize("at", [0, 1, 500, 999])
def test_a_damaged_time_costs_its_own_event(tmp_path, events, at, since_us, wrong):
    """All bits set would be nearest to a time below zero: after it, all was 72 minutes late."""
    late = Events(events.x, events.y, events.t + since_us, events.p)
    path = written(tmp_path / "a.dat", late)
    raw = bytearray(path.read_bytes())
    stored = int.from_bytes(raw[-8 * (1000 - at) : -8 * (1000 - at) + 4], "little")
    changed = stored ^ 0x80000000 if wrong is None else wrong
    if abs(int(np.int32(np.uint32((changed - stored) & 0xFFFFFFFF)))) < 200_000:
        return  # as good as any other time of this recording
    raw[-8 * (1000 - at) : -8 * (1000 - at) + 4] = changed.to_bytes(4, "little")
    path.write_bytes(raw)
    with pytest.warns(EvimoWarning, match="1 events"):
        found = joined(list(open_events(path)))
    assert found.t.tolist() == np.delete(late.t, at).tolist()


@pytest.mark.parametrize("first_us", [0, 2**31 - 9_000, 2**32 - 9_000, 3 * 2**32 - 9_000])
def test_times_are_the_same_together_and_one_by_one(first_us):
    """Of three blocks: steady, with a wrap, with late events, or with a damaged time."""
    draw = np.random.default_rng(5)
    t = first_us + np.sort(draw.integers(0, 18_000, 3 * 4096))
    t[5000:5100] = t[5000:5100][::-1]
    t[9000] ^= 1 << 30
    records = np.stack([t & 0xFFFFFFFF, np.zeros(len(t), np.int64)], axis=1).astype(np.uint32)
    expected = np.where(np.arange(len(t)) == 9000, 0, t)
    for sizes in ([len(t)], [1, 4000, len(t) - 4001]):
        state, found = np.array([first_us - 10]), []
        for part in np.split(records, np.cumsum(sizes)[:-1]):
            found.append(decode_dat(part, state, False, (14, 14, 28))[2])
        assert np.array_equal(np.where(np.arange(len(t)) == 9000, 0, np.concatenate(found)), expected)
