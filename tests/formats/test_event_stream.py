"""Event Stream, against a writer that follows the specification byte by byte."""

import struct

import pytest

from evimo.errors import BadFile, EvimoWarning
from evimo.formats import event_stream, open_events

HEIGHT, WIDTH = 48, 64


def header(kind, major=2):
    return b"Event Stream" + bytes([major, 0, 0, kind]) + struct.pack("<HH", WIDTH, HEIGHT)


def dvs_bytes(events):
    body, now = b"", 0
    for x, y, t, p in zip(events.x, events.y, events.t, events.p, strict=True):
        overflows, step = divmod(int(t) - now, 127)
        body += b"\xff" * overflows + bytes([step << 1 | (p > 0)]) + struct.pack("<HH", x, HEIGHT - 1 - y)
        now = int(t)
    return body


def atis_bytes(events):
    """Each change detection is followed by an exposure measurement, 1 µs later."""
    body, now = b"", 0
    for x, y, t, p in zip(events.x, events.y, 2 * events.t, events.p, strict=True):
        rounds, step = divmod(int(t) - now, 63)
        threes, rest = divmod(rounds, 3)
        body += b"\xff" * threes + (bytes([0xFC | rest]) if rest else b"")
        pixel = struct.pack("<HH", x, HEIGHT - 1 - y)
        body += bytes([step << 2 | (p > 0) << 1]) + pixel + bytes([1 << 2 | 1]) + pixel
        now = int(t) + 1
    return body


@pytest.fixture
def recording(tmp_path, events):
    path = tmp_path / "a.es"
    path.write_bytes(header(1) + dvs_bytes(events))
    return path


def test_what_was_written_is_read(recording, events, rows):
    opened = open_events(recording)
    assert (opened.sensor, opened.start_us, opened.stop_us) == ((HEIGHT, WIDTH), events.t[0], events.t[-1] + 1)
    assert rows(opened) == rows([events])


def test_blocks_of_any_size_give_the_same(recording, events, rows, monkeypatch):
    for size in (7, 64, 999):
        monkeypatch.setattr(event_stream, "BLOCK_BYTES", size)
        opened = open_events(recording)
        assert rows(opened) == rows([events])
        assert rows(opened.packets(70_000, 130_000)) == rows([events.between(70_000, 130_000)])


def test_atis_change_detections_are_read_and_exposures_left_out(tmp_path, events, rows):
    spread = type(events)(events.x, events.y, events.t + range(len(events)), events.p)  # room for the exposures
    path = tmp_path / "a.es"
    path.write_bytes(header(2) + atis_bytes(spread))
    assert [(x, y, t // 2, p) for x, y, t, p in rows(open_events(path))] == rows([spread])


def test_rows_are_counted_from_the_top(tmp_path):
    path = tmp_path / "a.es"
    path.write_bytes(header(1) + bytes([1]) + struct.pack("<HH", 5, 0))
    (packet,) = open_events(path)
    assert packet.y.tolist() == [HEIGHT - 1]


def test_a_file_cut_inside_an_event_is_used_with_a_warning(recording, events, rows):
    recording.write_bytes(recording.read_bytes()[:-2])
    with pytest.warns(EvimoWarning, match="its last 3 bytes are left out"):
        opened = open_events(recording)
    assert rows(opened) == rows([events.part(0, len(events) - 1)])


def test_pixels_outside_are_dropped_and_counted(tmp_path):
    path = tmp_path / "a.es"
    outside = [(WIDTH, 0), (0, HEIGHT), (65535, 65535)]
    path.write_bytes(header(1) + b"".join(bytes([3]) + struct.pack("<HH", *at) for at in [(0, 0), *outside]))
    with pytest.warns(EvimoWarning, match="3 events outside the 64x48 sensor"):
        assert sum(map(len, open_events(path))) == 1


@pytest.mark.parametrize(
    "content, words",
    [
        (header(1), "holds no events"),
        (header(1)[:17], "ends inside its header"),
        (header(1, major=1), "version 1"),
        (header(0), "generic"),
        (header(4), "colour"),
    ],
)
def test_what_cannot_be_read_is_said(tmp_path, content, words):
    path = tmp_path / "a.es"
    path.write_bytes(content)
    with pytest.raises(BadFile, match=words):
        open_events(path)
