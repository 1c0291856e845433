"""AEDAT 2.0, against records packed one by one from jAER's layout."""

import struct

import numpy as np
import pytest

from evimo.errors import BadFile, EvimoWarning
from evimo.formats import aedat2, open_events, word_file

FIRST_LINE = b"#!AER-DAT2.0\r\n# This is a raw AE data file - do not edit\r\n"
CHIP = b"# AEChip: eu.seebetter.ini.chips.davis.DAVIS240C\r\n"
RANGE = b'#   <entry key="ImuGyroScale" value="GyroFullScaleDegPerSec500"/>\r\n'
WIDTH, HEIGHT = 240, 180


def packed(address, t_us):
    return struct.pack(">II", address, t_us % 2**32)


def davis(x, y, p):
    return (HEIGHT - 1 - y) << 22 | (WIDTH - 1 - x) << 12 | (p > 0) << 11


def imu(t_us, rate):
    """The seven values of a sample; those of the gyroscope are given."""
    values = (1, -2, 3, 4, *rate)
    return b"".join(packed(1 << 31 | at << 28 | (v & 0xFFFF) << 12 | 3 << 10, t_us) for at, v in enumerate(values))


def records(events):
    return [packed(davis(x, y, p), t) for x, y, t, p in zip(*map(np.ndarray.tolist, columns(events)), strict=True)]


def columns(events):
    return events.x, events.y, events.t, events.p


def write(path, *parts, head=FIRST_LINE + CHIP + RANGE):
    path.write_bytes(head + b"".join(parts))
    return path


def test_what_was_written_is_read(tmp_path, events, rows, monkeypatch):
    for block in (1, 7, 1 << 17):
        monkeypatch.setattr(word_file, "BLOCK_BYTES", 8 * block)
        opened = open_events(write(tmp_path / "a.aedat", *records(events)))
        assert (opened.sensor, opened.start_us, opened.stop_us) == ((180, 240), events.t[0], events.t[-1] + 1)
        assert rows(opened) == rows([events])
        assert rows(opened.packets(70_000, 130_000)) == rows([events.between(70_000, 130_000)])
    assert opened.gyroscope() is None and opened.contents == {}


def test_dvs128_is_known_by_its_short_addresses(tmp_path):
    body = [packed((127 - y) << 8 | (127 - x) << 1 | (p < 0), t) for x, y, t, p in [(0, 1, 5, 1), (127, 100, 9, -1)]]
    mark = packed(1 << 15 | 17, 7)
    opened = open_events(write(tmp_path / "a.dat", body[0], mark, body[1], head=FIRST_LINE))
    (packet,) = opened
    assert opened.sensor == (128, 128) and opened.gyroscope() is None
    assert [column.tolist() for column in columns(packet)] == [[0, 127], [1, 100], [5, 9], [1, -1]]


@pytest.mark.parametrize("first_us", [2**31 - 100, 2**32 - 100])
def test_times_go_on_where_their_bits_wrap(tmp_path, monkeypatch, first_us):
    monkeypatch.setattr(word_file, "BLOCK_BYTES", 24)
    times = [first_us + 40 * k for k in range(8)]
    opened = open_events(write(tmp_path / "a.aedat", *(packed(davis(1, 2, 1), t) for t in times)))
    assert [t for packet in opened for t in packet.t.tolist()] == times
    assert [t for packet in opened.packets(times[5]) for t in packet.t.tolist()] == times[5:]


def test_the_gyroscope_is_scaled_by_the_range_in_the_header(tmp_path, events, rows, monkeypatch):
    for module in aedat2, word_file:
        monkeypatch.setattr(module, "BLOCK_BYTES", 8 * 5)  # samples lie across blocks
    parts = records(events)
    samples = [(int(events.t[at]), (at, -at, 7)) for at in (100, 300, 500, 900)]
    for at, sample in zip((101, 302, 503, 904), samples, strict=True):
        parts.insert(at, imu(*sample))
    frame, signal = packed(1 << 31 | 5 << 12 | 1 << 10, 0), packed(1 << 10 | 1 << 22, 0)
    opened = open_events(write(tmp_path / "a.aedat", frame, signal, *parts, imu(200_000, (1, 1, 1))[:-8]))
    assert rows(opened) == rows([events])
    assert opened.contents["IMU"] == "4 samples" and "frames" in opened.contents
    found = opened.gyroscope()
    assert found.t_us.tolist() == [t for t, _ in samples] and not found.in_camera_axes
    assert np.allclose(found.rate, np.radians(np.array([rate for _, rate in samples]) * 500 / 32768))


def test_without_a_range_it_is_assumed_with_a_warning(tmp_path, events):
    path = write(tmp_path / "a.aedat", *records(events), imu(1, (32, 0, 0)), imu(2, (32, 0, 0)), head=FIRST_LINE + CHIP)
    with pytest.warns(EvimoWarning, match="1000 degrees/s are taken"):
        assert np.allclose(open_events(path).gyroscope().rate[:, 0], np.radians(1000 / 1024))


def test_a_first_record_that_begins_like_a_comment_is_no_header(tmp_path):
    at = davis(10, HEIGHT - 1 - 140, 1)
    assert packed(at, 0)[0] == ord("#")
    opened = open_events(write(tmp_path / "a.aedat", packed(at, 10), packed(at, 11)))
    assert sum(map(len, opened)) == 2


def test_a_davis_of_unknown_size_is_assumed_with_a_warning(tmp_path, events, rows):
    with pytest.warns(EvimoWarning, match="taken as 240x180"):
        opened = open_events(write(tmp_path / "a.aedat", *records(events), head=FIRST_LINE))
    assert rows(opened) == rows([events])


@pytest.mark.parametrize("left", [0, 7])
def test_a_file_cut_before_its_first_record_is_refused(tmp_path, events, left):
    path = write(tmp_path / "a.aedat", records(events)[0][:left])
    with pytest.raises(BadFile, match="ends before its first record"):
        open_events(path)


def test_a_file_cut_inside_a_record_is_read_with_a_warning(tmp_path, events, rows):
    path = write(tmp_path / "a.aedat", imu(0, (1, 2, 3)), imu(1, (1, 2, 3)), *records(events))
    path.write_bytes(path.read_bytes()[:-3])
    with pytest.warns(EvimoWarning, match="ends inside a record: its last 5 bytes are left out"):
        opened = open_events(path)
    assert rows(opened) == rows([events.part(0, len(events) - 1)]) and len(opened.gyroscope()) == 2


def test_without_an_event_or_of_another_chip_it_is_refused(tmp_path):
    with pytest.raises(BadFile, match="holds no events"):
        open_events(write(tmp_path / "a.aedat", imu(5, (1, 2, 3))))
    head = FIRST_LINE + b"# AEChip: ch.unizh.ini.jaer.chip.cochlea.CochleaAMS1c\r\n"
    with pytest.raises(BadFile, match="recorded with CochleaAMS1c"):
        open_events(write(tmp_path / "a.aedat", packed(5, 5), head=head))


def test_the_gyroscope_of_a_real_recording(shared_data):
    """Its header says 1000 degrees/s; the camera pans about its vertical axis, the last sample lacks an axis."""
    opened = open_events(shared_data("recordings/davis240_boxes_imu/IMU_translBoxes.aedat"))
    found = opened.gyroscope()
    assert (len(found), opened.contents["IMU"]) == (4833, "4,833 samples")
    assert 2400 < found.rate_hz < 2500
    assert found.rate.std(axis=0).argmax() == 1
    assert abs(found.t_us[0] - opened.start_us) < 1000 and abs(found.t_us[-1] - opened.stop_us) < 1000
