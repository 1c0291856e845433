"""ROS 1 bags, against the writer of the rosbags library."""

import struct

import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

from evimo.errors import BadFile, EvimoWarning
from evimo.formats import open_events
from evimo.formats.rosbag1 import open_bag

TYPES = get_typestore(Stores.ROS1_NOETIC)
PART, EPOCH_US = 100, 1_600_000_000_000_000


def stamp(t_us):
    return struct.pack("<II", t_us // 10**6, t_us % 10**6 * 1000)


def top(t_us):
    return struct.pack("<I", 7) + stamp(t_us) + struct.pack("<I", 3) + b"cam"


def array_message(part):
    body = b"".join(
        struct.pack("<HH", x, y) + stamp(t) + struct.pack("<?", p > 0)
        for x, y, t, p in zip(part.x.tolist(), part.y.tolist(), part.t.tolist(), part.p.tolist(), strict=True)
    )
    return top(int(part.t[0])) + struct.pack("<III", 48, 64, len(part)) + body


def mono_message(part):
    base = int(part.t[0]) * 1000
    packed = b"".join(
        struct.pack("<Q", (t * 1000 - base) | x << 32 | y << 48 | (p > 0) << 63)
        for x, y, t, p in zip(part.x.tolist(), part.y.tolist(), part.t.tolist(), part.p.tolist(), strict=True)
    )
    return packet_message(part, b"mono", base, packed)


def packet_message(part, encoding, base, packed):
    return (
        top(int(part.t[0]))
        + struct.pack("<IIQQI", 48, 64, 0, base, len(encoding))
        + encoding
        + struct.pack("<?I", False, len(packed))
        + packed
    )


KINDS = {"dvs_msgs/msg/EventArray": array_message, "event_camera_msgs/msg/EventPacket": mono_message}


def write(path, events, kind="dvs_msgs/msg/EventArray", compression=None, message=None):
    writer = Writer(path)
    if compression:
        writer.set_compression(compression)
    with writer:
        topic = writer.add_connection("/cam/events", kind, msgdef="Header header", md5sum="0" * 32)
        imu = writer.add_connection("/cam/imu", "sensor_msgs/msg/Imu", typestore=TYPES)
        info = writer.add_connection("/cam/camera_info", "sensor_msgs/msg/CameraInfo", typestore=TYPES)
        writer.write(info, int(events.t[0]) * 1000, camera_info())
        for first in range(0, len(events), PART):
            part = events.part(first, first + PART)
            recorded = int(part.t[-1]) * 1000 + 500_000
            writer.write(topic, recorded, (message or KINDS[kind])(part))
            writer.write(imu, recorded, b"\0" * 300)
            writer.write_chunk(writer.chunks[-1])
    return path


def camera_info():
    kinds = TYPES.types
    header = kinds["std_msgs/msg/Header"](
        seq=0, stamp=kinds["builtin_interfaces/msg/Time"](sec=1, nanosec=0), frame_id=""
    )
    region = kinds["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    matrix = np.array([50.0, 0, 31, 0, 51, 23, 0, 0, 1])
    message = kinds["sensor_msgs/msg/CameraInfo"](
        header=header,
        height=48,
        width=64,
        distortion_model="plumb_bob",
        D=np.array([0.1, 0.2, 0.3, 0.4, 0.5]),
        K=matrix,
        R=matrix,
        P=np.zeros(12),
        binning_x=0,
        binning_y=0,
        roi=region,
    )
    return TYPES.serialize_ros1(message, "sensor_msgs/msg/CameraInfo")


@pytest.fixture
def absolute(events):
    """The same events, in the clock of a robot."""
    return type(events)(events.x, events.y, EPOCH_US + 50 * events.t, events.p)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("compression", [None, Writer.CompressionFormat.BZ2, Writer.CompressionFormat.LZ4])
def test_what_was_written_is_read(tmp_path, absolute, rows, kind, compression):
    opened = open_events(write(tmp_path / "a.bag", absolute, kind, compression))
    assert (opened.sensor, opened.start_us, opened.stop_us) == ((48, 64), absolute.t[0], absolute.t[-1] + 1)
    assert rows(opened) == rows([absolute])
    start = EPOCH_US + 6_000_000
    assert rows(opened.packets(start, start + 1_000_000)) == rows([absolute.between(start, start + 1_000_000)])


def test_seeking_skips_most_chunks(tmp_path, absolute, monkeypatch):
    opened = open_events(write(tmp_path / "a.bag", absolute))
    assert len(open_bag(opened.path).chunks) > 8
    first = next(iter(opened.read(EPOCH_US + 9_000_000)))
    assert EPOCH_US + 5_000_000 < first.t[0] < EPOCH_US + 9_000_000


def test_what_else_is_inside_is_told(tmp_path, absolute):
    opened = open_events(write(tmp_path / "a.bag", absolute))
    assert opened.contents == {
        "event topics": "/cam/events (10)",
        "IMU": "/cam/imu (10)",
        "camera info": "/cam/camera_info (1)",
    }
    found = opened.camera.camera
    assert (found.fx, found.fy, found.cx, found.cy, found.distortion[2]) == (50, 51, 31, 23, 0.3)


@pytest.mark.parametrize("compression", [None, Writer.CompressionFormat.LZ4])
def test_a_bag_that_was_cut_short_is_used_with_a_warning(tmp_path, absolute, rows, compression):
    path = write(tmp_path / "a.bag", absolute, compression=compression)
    path.write_bytes(path.read_bytes()[: open_bag(path).chunks[6].offset + 100])
    with pytest.warns(EvimoWarning, match="lost its index"):
        opened = open_events(path)
    seen = rows(opened)
    assert len(seen) >= 400 and seen == rows([absolute])[: len(seen)]


def test_messages_of_a_half_chunk_are_read(tmp_path, absolute, rows):
    path = write(tmp_path / "a.bag", absolute)
    chunk = open_bag(path).chunks[1]
    path.write_bytes(path.read_bytes()[: chunk.offset + 1800])
    with pytest.warns(EvimoWarning, match="lost its index"):
        seen = rows(open_events(path))
    assert seen == rows([absolute])[: len(seen)]


@pytest.mark.parametrize(
    "compression, hole", [(None, 0), (Writer.CompressionFormat.LZ4, 0), (Writer.CompressionFormat.LZ4, 150)]
)
def test_messages_of_a_damaged_chunk_are_left_out_and_counted(tmp_path, absolute, rows, compression, hole):
    path = write(tmp_path / "a.bag", absolute, compression=compression)
    chunk, raw = open_bag(path).chunks[3], bytearray(path.read_bytes())
    first = chunk.offset + hole  # of the chunk's own header, or of its records
    raw[first : first + 200] = bytes(200)
    path.write_bytes(raw)
    with pytest.warns(EvimoWarning, match="1 messages of /cam/events are damaged"):
        assert len(rows(open_events(path))) == len(absolute) - PART


def test_a_bag_whose_index_is_damaged_is_walked(tmp_path, absolute, rows):
    path = write(tmp_path / "a.bag", absolute)
    raw = bytearray(path.read_bytes())
    raw[-400:-200] = bytes(200)  # of the places of the last chunks
    path.write_bytes(raw)
    with pytest.warns(EvimoWarning, match="lost its index: its 10 readable chunks are used"):
        assert rows(open_events(path)) == rows([absolute])


def test_a_bag_cut_before_its_first_message_is_refused(tmp_path, absolute):
    path = write(tmp_path / "a.bag", absolute)
    path.write_bytes(path.read_bytes()[:4200])
    with pytest.raises(BadFile, match="without a readable chunk"):
        open_events(path)


def test_a_bag_without_events_says_what_it_holds(tmp_path):
    with Writer(tmp_path / "a.bag") as writer:
        imu = writer.add_connection("/cam/imu", "sensor_msgs/msg/Imu", typestore=TYPES)
        writer.write(imu, 1, b"\0" * 300)
    with pytest.raises(BadFile, match="no event messages, only /cam/imu"):
        open_events(tmp_path / "a.bag")


def test_an_unknown_encoding_is_said(tmp_path, absolute):
    path = write(
        tmp_path / "a.bag",
        absolute,
        "event_camera_msgs/msg/EventPacket",
        message=lambda part: packet_message(part, b"evt9", 0, b"\0" * 8),
    )
    with pytest.raises(BadFile, match="'evt9' are not supported"):
        open_events(path)


def test_of_two_event_topics_the_larger_is_read_and_said(tmp_path, events):
    with Writer(tmp_path / "a.bag") as writer:
        for topic, count in (("/left", 1), ("/right", 3)):
            made = writer.add_connection(topic, "dvs_msgs/msg/EventArray", msgdef="Header header", md5sum="0" * 32)
            for first in range(count):
                writer.write(made, first, array_message(events.part(100 * first, 100 * first + 100)))
    with pytest.warns(EvimoWarning, match="/right is read"):
        assert sum(map(len, open_events(tmp_path / "a.bag"))) == 300


def evt3_message(part):
    """Every event with all its words."""
    words = [
        word
        for x, y, t, p in zip(part.x.tolist(), part.y.tolist(), part.t.tolist(), part.p.tolist(), strict=True)
        for word in (8 << 12 | t >> 12 & 0xFFF, 6 << 12 | t & 0xFFF, y, 2 << 12 | (p > 0) << 11 | x)
    ]
    return packet_message(part, b"evt3", 0, struct.pack(f"<{len(words)}H", *words))


def test_seeking_finds_the_round_of_a_clock_that_wraps_every_17_seconds(tmp_path, events, rows):
    long = type(events)(events.x, events.y, 3_000_000 + 500 * events.t, events.p)  # 100 s, six rounds
    kind = "event_camera_msgs/msg/EventPacket"
    opened = open_events(write(tmp_path / "a.bag", long, kind, message=evt3_message))
    assert (opened.start_us, opened.stop_us) == (long.t[0], long.t[-1] + 1)
    assert rows(opened) == rows([long])
    for start in (20_000_000, 60_000_000, 95_000_000):
        assert rows(opened.packets(start, start + 5_000_000)) == rows([long.between(start, start + 5_000_000)])
