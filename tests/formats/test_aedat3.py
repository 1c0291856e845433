"""AEDAT 3, against packets packed one by one from iniVation's documentation."""

import struct

import numpy as np
import pytest

from evimo.errors import BadFile, EvimoWarning, NotFound
from evimo.events.events import Events, joined
from evimo.formats import open_events, word_file

HEAD = "#!AER-DAT3.1\r\n#Format: {packing}\r\n#Source 1: {chip}\r\n#Start-Time: 2016-09-15\r\n#!END-HEADER\r\n"


def packet(kind, records, *, size=8, overflow=0, valid=None):
    count = len(records)
    head = struct.pack("<HHIIIIII", kind, 1, size, 4, overflow, count, count, count if valid is None else valid)
    return head + b"".join(records)


def polarity(x, y, t, p, *, valid=True):
    return struct.pack("<II", x << 17 | y << 2 | (p > 0) << 1 | valid, t % 2**31)


def packets(events, *, size=100):
    found = []
    columns = (column.tolist() for column in (events.x, events.y, events.t, events.p))
    rows = list(zip(*columns, strict=True))
    rounds = [row[2] >> 31 for row in rows]
    first = 0
    while first < len(rows):
        last = first
        while last < min(first + size, len(rows)) and rounds[last] == rounds[first]:
            last += 1
        found.append(packet(1, [polarity(*row) for row in rows[first:last]], overflow=rounds[first]))
        first = last
    return found


def written(path, *parts, chip="DAVIS240C", packing="RAW"):
    path.write_bytes(HEAD.format(chip=chip, packing=packing).encode() + b"".join(parts))
    return path


@pytest.mark.parametrize("block", [30, 1000, 1 << 19])
def test_what_was_written_is_read(tmp_path, events, rows, monkeypatch, block):
    monkeypatch.setattr(word_file, "BLOCK_BYTES", block)
    opened = open_events(written(tmp_path / "a.aedat", *packets(events)))
    assert (opened.sensor, opened.start_us, opened.stop_us) == ((180, 240), events.t[0], events.t[-1] + 1)
    assert rows(opened) == rows([events])
    assert rows(opened.packets(70_000, 130_000)) == rows([events.between(70_000, 130_000)])


def test_other_packets_are_counted_and_invalid_events_left_out(tmp_path, events, rows):
    parts = packets(events)
    invalid = packet(1, [polarity(1, 1, 5, 1, valid=False)], valid=0)
    imu, signal = packet(3, [bytes(36)] * 4, size=36), packet(0, [bytes(8)] * 2)
    frame = packet(2, [bytes(36 + 2 * 240 * 180)], size=36 + 2 * 240 * 180)
    opened = open_events(written(tmp_path / "a.aedat", imu, invalid, *parts[:3], frame, signal, *parts[3:]))
    assert rows(opened) == rows([events])
    assert opened.contents == {"signals": "2", "frames": "1", "IMU (6 axes)": "4"}


def test_times_go_on_where_their_31_bits_wrap(tmp_path, events):
    late = Events(events.x, events.y, events.t + 2**31 - 100_000, events.p)
    opened = open_events(written(tmp_path / "a.aedat", *packets(late)))
    assert joined(list(opened)).t.tolist() == late.t.tolist()


@pytest.mark.parametrize("chip, size", [("DVS128", (128, 128)), ("DAVIS346B", (260, 346)), ("Unknown", (128, 128))])
@pytest.mark.filterwarnings("ignore:a.aedat does not tell")
def test_the_header_names_the_camera(tmp_path, events, chip, size):
    assert open_events(written(tmp_path / "a.aedat", *packets(events), chip=chip)).sensor == size


def test_a_file_cut_inside_a_packet_is_read_as_far_as_it_goes(tmp_path, events, rows):
    path = written(tmp_path / "a.aedat", *packets(events))
    path.write_bytes(path.read_bytes()[:-25])
    assert rows(open_events(path)) == rows([events.part(0, 996)])


@pytest.mark.parametrize("block", [2000, 1 << 19])
def test_after_a_damaged_packet_the_next_is_found(tmp_path, events, rows, monkeypatch, block):
    monkeypatch.setattr(word_file, "BLOCK_BYTES", block)
    parts = packets(events)
    noise = np.random.default_rng(0).integers(0, 256, 28, np.uint8).tobytes()
    parts[4] = noise + parts[4][28:]
    opened = open_events(written(tmp_path / "a.aedat", *parts))
    with pytest.warns(EvimoWarning, match="103 events beside damaged words are lost"):
        assert rows(opened) == rows([events.part(0, 400), events.part(500, 1000)])


def test_what_is_packed_otherwise_is_said(tmp_path, events):
    with pytest.raises(BadFile, match="packed as SerializedTS"):
        open_events(written(tmp_path / "a.aedat", *packets(events), packing="SerializedTS"))


def test_without_events_it_says_so(tmp_path):
    with pytest.raises(BadFile, match="holds no events"):
        open_events(written(tmp_path / "a.aedat", packet(3, [bytes(36)], size=36)))


def test_a_packet_whose_wraps_are_damaged_goes_by_its_neighbours(tmp_path, events, rows):
    parts = packets(events)
    parts[4] = parts[4][:12] + b"\x40" + parts[4][13:]
    assert rows(open_events(written(tmp_path / "a.aedat", *parts))) == rows([events])


@pytest.mark.parametrize("late_us", [0, 7_000_000])
def test_of_several_cameras_one_is_read_and_said(tmp_path, events, rows, late_us):
    other = Events(63 - events.x, events.y, events.t + late_us, events.p).part(0, 900)
    theirs = [part[:2] + struct.pack("<H", 2) + part[4:] for part in packets(other)]
    mixed = [part for pair in zip(packets(events), theirs, strict=False) for part in pair]
    path = written(tmp_path / "a.aedat", *mixed, packets(events)[-1], chip="DAVIS240C\r\n#Source 2: DVS128")
    with pytest.warns(EvimoWarning, match="several cameras: 1/DAVIS240C, 2/DVS128; 1/DAVIS240C is read"):
        opened = open_events(path)
    assert opened.sensor == (180, 240) and rows(opened) == rows([events])
    for topic in ("2", "DVS128"):
        chosen = open_events(path, topic=topic)
        assert chosen.sensor == (128, 128) and rows(chosen) == rows([other])
        assert (chosen.topic, chosen.contents["topics"]) == ("2/DVS128", "1/DAVIS240C, 2/DVS128")
    with pytest.raises(NotFound, match="no events --topic 3"):
        open_events(path, topic="3")


def test_one_camera_alone_has_a_name_too(tmp_path, events, rows):
    path = written(tmp_path / "a.aedat", *packets(events), chip="DAVIS240C")
    assert rows(open_events(path, topic="DAVIS240C")) == rows([events])
    with pytest.raises(NotFound, match=r"no events --topic 3.*\n.*one of: 1/DAVIS240C"):
        open_events(path, topic="3")
