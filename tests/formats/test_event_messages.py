"""Event encodings of event_camera_msgs, against sums that its own project publishes, and against words made by hand."""

import csv
import hashlib
import sqlite3
import struct

import numpy as np
import pytest

from evimo.events.events import joined
from evimo.formats.event_message_kernel import decode_evt3, evt3_state
from evimo.formats.event_messages import EventPacket, PacketDecoder


def ros2_packet(raw):
    """A CDR-serialised EventPacket: fields aligned to their size, counted after the first four bytes."""
    at = 4 + 8

    def field(form):
        nonlocal at
        size = struct.calcsize(form)
        at = 4 + -(-(at - 4) // size) * size
        at += size
        return struct.unpack_from("<" + form, raw, at - size)[0]

    def sequence():
        nonlocal at
        size = field("I")
        at += size
        return raw[at - size : at]

    sequence()
    size = field("I"), field("I")
    field("Q")
    base, encoding, _ = field("Q"), sequence(), field("B")
    return EventPacket(size, base, encoding.rstrip(b"\0").decode(), memoryview(sequence()))


def stored_events(path):
    decoder = PacketDecoder(path.name)
    with sqlite3.connect(f"file:{path}?mode=ro&immutable=1", uri=True) as database:
        messages = database.execute("select data from messages order by timestamp").fetchall()
    return joined([decoder.decoded(ros2_packet(raw)) for (raw,) in messages])


def sums(events):
    return tuple(int(np.sum(column.astype(np.uint64))) for column in (events.t, events.x, events.y, events.p > 0))


@pytest.mark.parametrize(
    "name, expected",
    [
        # event_camera_codecs, test/decoder_test.cpp; its times are in ns
        ("test_data_evt3_trigger/test_data_evt3_trigger_0.db3", (1_222_326_831_810, 42_078_718, 31_656_267, 41_439)),
        ("test_data_mono_cd/test_data_mono_cd_0.db3", (4_950, 34_450, 26_450, 50)),
    ],
)
def test_sums_are_those_that_the_encodings_project_publishes(shared_data, name, expected):
    assert sums(stored_events(shared_data(f"formats/ros/{name}"))) == expected


def test_libcaer_times_go_on_where_the_clock_wraps(shared_data):
    events = stored_events(shared_data("formats/ros/test_data_libcaer_rollover/libcaer_rollover_0.db3"))
    steps = np.diff(events.t)
    assert len(events) == 334_331
    assert steps.min() >= 0 and steps.max() < 1_000_000


def test_libcaer_wraps_inside_a_packet():
    packed = b"".join(struct.pack("<II", 5 << 17 | 7 << 2 | 1 << 1, low) for low in (2**31 - 1, 3))
    events = PacketDecoder("x").decoded(EventPacket((48, 64), 1_000_000, "libcaer", memoryview(packed)))
    assert events.t.tolist() == [1000 + 2**31 - 1, 1000 + 2**31 + 3]
    assert (events.x.tolist(), events.y.tolist(), events.p.tolist()) == ([5, 5], [7, 7], [1, 1])


def words(*codes):
    return np.array([kind << 12 | value for kind, value in codes], np.uint16)


def test_evt3_words_by_hand():
    stream = words(
        (2, 9),  # before any time: left out
        (8, 3),
        (6, 21),
        (0, 40),
        (2, 1 << 11 | 9),  # on at (9, 40)
        (3, 1 << 11 | 16),
        (4, 0b100000000001),  # on at 16 and 27
        (5, 0b10),  # the base has moved on by 12: on at 29
        (6, 22),
        (10, 0),  # a trigger
        (2, 63),  # off at (63, 40)
    )
    x, y, t, p = decode_evt3(stream, evt3_state(0))
    assert x.tolist() == [9, 16, 27, 29, 63]
    assert y.tolist() == [40] * 5
    assert t.tolist() == [3 * 4096 + 21] * 4 + [3 * 4096 + 22]
    assert p.tolist() == [1, 1, 1, 1, -1]


def test_evt3_state_goes_from_one_message_to_the_next():
    stream = words((8, 3), (6, 21), (0, 40), (3, 16), (4, 3), (5, 1), (2, 5), (8, 4), (6, 0), (2, 6))
    whole = decode_evt3(stream, evt3_state(0))
    for cut in range(1, len(stream)):
        state = evt3_state(0)
        parts = decode_evt3(stream[:cut], state), decode_evt3(stream[cut:], state)
        for column in range(4):
            assert np.concatenate([part[column] for part in parts]).tolist() == whole[column].tolist()


def test_evt3_clock_wraps_every_24_bits_and_starts_in_the_expected_round():
    stream = words((8, 4095), (6, 0), (2, 1), (8, 4094), (6, 1), (2, 1), (8, 0), (6, 2), (2, 1))
    t = decode_evt3(stream, evt3_state(0))[2]
    assert t.tolist() == [4095 << 12, 4094 << 12 | 1, 1 << 24 | 2]
    later = decode_evt3(stream, evt3_state(5 * (1 << 24) - 3000))[2]
    assert (later - t).tolist() == [4 << 24] * 3


def test_evt3_raw_file_has_the_expected_columns(shared_data):
    raw = shared_data("formats/prophesee/evt3.raw").read_bytes()
    while raw.startswith(b"%"):
        raw = raw.split(b"\n", 1)[1]
    x, y, t, p = decode_evt3(np.frombuffer(raw[: len(raw) // 2 * 2], "<u2"), evt3_state(0))
    with shared_data("formats/expected_digests.csv").open() as table:
        expected = {
            row["field"]: row["sha3_224_of_the_column_bytes"]
            for row in csv.DictReader(table)
            if row["format"] == "evt3"
        }
    columns = {"t": t.astype("<u8"), "x": x, "y": y, "on": p > 0}
    assert {name: hashlib.sha3_224(column.tobytes()).hexdigest() for name, column in columns.items()} == expected


def test_libcaer_cmp_words_by_hand():
    """A message stands for itself: time and column begin anew; the high part of the time sets the low one aside."""
    stream = words(
        (2, 17),  # a column
        (3, 1 << 11 | 40),  # on at (17, 40), at the base
        (1, 21),
        (3, 41),  # off at (17, 41), 21 µs later
        (2, 18),
        (4, 1 << 11 | 16),  # on, rows from 16
        (5, 0b10000001),  # at 16 and 23
        (5, 0b10),  # the base has moved on by 8: at 25
        (0, 3),
        (1, 5),
        (3, 0),  # off at (18, 0), 3 * 4096 + 5 µs after the base
        (6, 9),  # a kind that nobody uses
    )
    message = EventPacket((48, 64), 7_000_400, "libcaer_cmp", memoryview(stream.astype("<u2").tobytes() + b"odd"[:1]))
    events = PacketDecoder("x").decoded(message)
    assert events.x.tolist() == [17, 17, 18, 18, 18, 18]
    assert events.y.tolist() == [40, 41, 16, 23, 25, 0]
    assert events.t.tolist() == [7000, 7021, 7021, 7021, 7021, 7000 + 3 * 4096 + 5]
    assert events.p.tolist() == [1, -1, 1, 1, 1, -1]
