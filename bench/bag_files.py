"""Bags of ROS 1 and ROS 2 for `bench/readers.py`: one topic, one message per PART events."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
from lz4.frame import compress
from reader_files import evt3_words
from rosbags import rosbag1, rosbag2

from evimo.events.events import Events

WIDTH, HEIGHT, PART = 346, 260, 20_000
ROS1_HEAD, CDR_HEAD = bytes(16), b"\0\1\0\0" + bytes(12)  # a message's header without a frame
KINDS = {"array": "dvs_msgs/msg/EventArray"}


def write_bag1(folder: Path, events: Events, *, encoding: str) -> Path:
    """A ROS 1 bag."""
    path = folder / f"{encoding}.bag"
    _fill(rosbag1.Writer(path), events, encoding=encoding, cdr=False, md5sum="0" * 32)
    return path


def write_bag2(folder: Path, events: Events, *, encoding: str, storage: str) -> Path:
    """A ROS 2 bag: db3, mcap, or "mcap lz4" or "mcap zstd" with compressed chunks."""
    plugin = rosbag2.StoragePlugin.SQLITE3 if storage == "db3" else rosbag2.StoragePlugin.MCAP
    writer = rosbag2.Writer(folder / "bag", version=8, storage_plugin=plugin)
    if storage == "mcap zstd":
        writer.set_compression(rosbag2.CompressionMode.STORAGE, rosbag2.CompressionFormat.ZSTD)
    _fill(writer, events, encoding=encoding, cdr=True, lz4=storage == "mcap lz4", rihs01="RIHS01_0")
    return folder / "bag"


def _fill(writer: Any, events: Events, *, encoding: str, cdr: bool, lz4: bool = False, **definition: str) -> None:
    with writer:
        if lz4:
            writer.storage.compression, writer.storage.compressor = "lz4", compress
        kind = KINDS.get(encoding, "event_camera_msgs/msg/EventPacket")
        topic = writer.add_connection("/events", kind, msgdef="std_msgs/Header header", **definition)
        for first in range(0, len(events), PART):
            part = events.part(first, first + PART)
            payload = array(part, cdr=cdr) if encoding == "array" else packet(part, encoding, cdr=cdr)
            writer.write(topic, int(part.t[-1]) * 1000 + 1, payload)


def array(part: Events, *, cdr: bool) -> bytes:
    """A dvs_msgs/EventArray: 13 bytes an event; in CDR 16, where all but the first have x and y two bytes sooner."""
    head = (CDR_HEAD if cdr else ROS1_HEAD) + struct.pack("<III", HEIGHT, WIDTH, len(part))
    seconds, nanoseconds = part.t // 1_000_000, part.t % 1_000_000 * 1000
    if not cdr:
        stored = np.zeros(len(part), [("x", "<u2"), ("y", "<u2"), ("s", "<u4"), ("ns", "<u4"), ("p", "u1")])
        stored["x"], stored["y"], stored["p"], stored["s"], stored["ns"] = (
            part.x,
            part.y,
            part.p > 0,
            seconds,
            nanoseconds,
        )
        return head + stored.tobytes()
    bytes_ = np.zeros(16 * len(part), np.uint8)
    halves, words = bytes_.view("<u2"), bytes_.view("<u4")
    halves[7:-1:8], halves[8::8] = part.x[1:], part.y[1:]
    halves[:2] = part.x[0], part.y[0]
    words[1::4], words[2::4], bytes_[12::16] = seconds, nanoseconds, part.p > 0
    return head + bytes_[:-3].tobytes()


def packet(part: Events, encoding: str, *, cdr: bool) -> bytes:
    """An event_camera_msgs/EventPacket; in EVT 3 its words are those of a camera, which a driver passes on."""
    base = 0
    if encoding == "evt3":
        packed = evt3_words(part).tobytes()
    else:
        base = int(part.t[0]) * 1000
        t, x, y = ((column.astype(np.uint64)) for column in (part.t * 1000 - base, part.x, part.y))
        packed = (t | x << 32 | y << 48 | (part.p > 0).astype(np.uint64) << 63).tobytes()
    name, size = encoding.encode(), (HEIGHT, WIDTH)
    if cdr:
        return CDR_HEAD + struct.pack("<II4xQQI5s?2xI", *size, 0, base, 5, name, False, len(packed)) + packed
    return ROS1_HEAD + struct.pack("<IIQQI4s?I", *size, 0, base, 4, name, False, len(packed)) + packed
