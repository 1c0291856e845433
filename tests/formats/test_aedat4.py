"""AEDAT 4, against files written by iniVation's own library."""

import struct
from contextlib import nullcontext

import dv_processing
import numpy as np
import pytest

from evimo.errors import BadFile, EvimoWarning, NotFound
from evimo.formats import aedat4, aedat4_packets, open_events
from evimo.formats.aedat4_packets import head, packet_table, walked

CompressionType = dv_processing.CompressionType
PART = 100


def write(path, events, compression=CompressionType.LZ4):
    config = dv_processing.io.MonoCameraWriter.EventOnlyConfig("camera", (64, 48), compression)
    writer = dv_processing.io.MonoCameraWriter(str(path), config)
    for first in range(0, len(events), PART):
        store = dv_processing.EventStore()
        part = events.part(first, first + PART)
        for x, y, t, p in zip(part.x.tolist(), part.y.tolist(), part.t.tolist(), part.p.tolist(), strict=True):
            store.push_back(t, x, y, p > 0)
        writer.writeEvents(store)
    del writer
    return path


@pytest.fixture
def recording(tmp_path, events):
    return write(tmp_path / "a.aedat4", events)


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD])
def test_what_was_written_is_read(tmp_path, events, rows, compression):
    opened = open_events(write(tmp_path / "a.aedat4", events, compression))
    assert (opened.sensor, opened.start_us, opened.stop_us) == ((48, 64), events.t[0], events.t[-1] + 1)
    assert rows(opened) == rows([events])
    assert rows(opened.packets(70_000, 130_000)) == rows([events.between(70_000, 130_000)])
    assert opened.contents["camera name"] == "camera"


@pytest.mark.parametrize("together", [1, 150, 250])
@pytest.mark.parametrize("cut", [False, True])
def test_packets_are_read_together_from_any_time_on(recording, events, rows, monkeypatch, together, cut):
    monkeypatch.setattr(aedat4, "TOGETHER", together)
    if cut:  # without its table it is walked
        recording.write_bytes(recording.read_bytes()[: head(recording).table_at])
    with pytest.warns(EvimoWarning, match="cut short") if cut else nullcontext():
        opened = open_events(recording)
    for start in range(0, 200_000, 17_000):
        assert rows(opened.packets(start)) == rows([events.between(start, events.t[-1] + 1)])


def test_a_packet_larger_than_most_is_unpacked_whole(tmp_path, events, rows, monkeypatch):
    monkeypatch.setattr(aedat4_packets, "LIKELY_BYTES", 100)
    assert rows(open_events(write(tmp_path / "a.aedat4", events))) == rows([events])


def test_few_events_do_not_keep_room_for_many(tmp_path, events):
    for packet in open_events(write(tmp_path / "a.aedat4", events)).read(0):
        assert all(column.base is None for column in (packet.x, packet.y, packet.t, packet.p))


def test_the_table_says_what_the_packets_hold(recording, events):
    top = head(recording)
    table = packet_table(recording, top).of(0)
    assert table.offset.tolist() == [at for at, _ in walked(recording, top.first_packet, top.table_at)]
    assert table.count.sum() == len(events)
    assert (table.start_us[0], table.stop_us[-1]) == (events.t[0], events.t[-1])


def test_a_file_that_was_cut_short_is_used_with_a_warning(recording, events, rows):
    whole = recording.read_bytes()
    third = packet_table(recording, head(recording)).of(0).offset[3]
    recording.write_bytes(whole[: third + 50])
    with pytest.warns(EvimoWarning, match="cut short: its first 300 events"):
        opened = open_events(recording)
    assert rows(opened) == rows([events.part(0, 300)])
    assert rows(opened.packets(30_000, 40_000)) == rows([events.part(0, 300).between(30_000, 40_000)])


def test_a_damaged_packet_is_left_out_and_counted(recording, events, rows):
    whole = bytearray(recording.read_bytes())
    at = packet_table(recording, head(recording)).of(0).offset[3]
    size = struct.unpack_from("<i", whole, at + 4)[0]
    whole[at + 8 : at + 8 + size] = b"\x55" * size
    recording.write_bytes(whole)
    with pytest.warns(EvimoWarning, match="1 packets of events are damaged"):
        assert rows(open_events(recording)) == rows([events.part(0, 300), events.part(400, len(events))])


@pytest.mark.parametrize("size", [14, 40, 200])
def test_a_file_cut_inside_its_head_is_refused(recording, size):
    recording.write_bytes(recording.read_bytes()[:size])
    with pytest.raises(BadFile, match="head is cut short"):
        open_events(recording)


def test_a_file_cut_before_the_first_events_is_refused(recording):
    recording.write_bytes(recording.read_bytes()[: head(recording).first_packet + 30])
    with pytest.raises(BadFile, match="holds no events"):
        open_events(recording)


def test_a_recording_of_frames_alone_is_refused(tmp_path):
    path = tmp_path / "a.aedat4"
    writer = dv_processing.io.MonoCameraWriter(
        str(path), dv_processing.io.MonoCameraWriter.FrameOnlyConfig("camera", (64, 48))
    )
    writer.writeFrame(dv_processing.Frame(1000, np.zeros((48, 64), np.uint8)))
    del writer
    with pytest.raises(BadFile, match="no stream of events"):
        open_events(path)


@pytest.mark.parametrize(
    "name, frames, imu",
    [
        ("recordings/davis346_road/davis346.aedat4", "59, 346x260", "2,363"),
        ("recordings/davis346_ball_person/dvSave-2021_01_15_15_43_05.aedat4", "19, 346x260", "740"),
    ],
)
def test_frames_and_imu_of_real_recordings_are_counted(shared_data, name, frames, imu):
    contents = open_events(shared_data(name)).contents
    assert (contents["frames"], contents["IMU"]) == (frames, imu)


@pytest.fixture
def stereo(tmp_path, events):
    """Events of two cameras, fewer of the left."""
    path, config = tmp_path / "a.aedat4", dv_processing.io.MonoCameraWriter.EventOnlyConfig
    sides = [config(name, (64, 48), CompressionType.LZ4) for name in ("camL", "camR")]
    writer = dv_processing.io.StereoCameraWriter(str(path), *sides)
    for side, count in ((writer.left, 900), (writer.right, 1000)):
        store = dv_processing.EventStore()
        part = events.part(0, count)
        for x, y, t, p in zip(part.x.tolist(), part.y.tolist(), part.t.tolist(), part.p.tolist(), strict=True):
            store.push_back(t, x, y, p > 0)
        side.writeEvents(store)
    del side, writer
    return path


def test_of_several_cameras_the_topic_chooses(stereo, events, rows):
    with pytest.warns(EvimoWarning, match="camR/events, camL/events; camR/events is read, --topic chooses"):
        opened = open_events(stereo)
    assert rows(opened) == rows([events])
    assert opened.contents["topics"] == "camR/events, camL/events"
    left = open_events(stereo, topic="camL")
    assert left.topic == "camL/events" and rows(left) == rows([events.part(0, 900)])
    with pytest.raises(NotFound, match=r"2 events in .* fit --topic cam"):
        open_events(stereo, topic="cam")
