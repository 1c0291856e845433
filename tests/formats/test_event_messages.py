"""Event encodings of event_camera_msgs, against sums that its own project publishes, and against words made by hand."""

import sqlite3
import struct

import numpy as np
import pytest

from evimo.events.events import joined
from evimo.formats import evt3_messages
from evimo.formats.event_messages import ArrayDecoder, EventPacket, PacketDecoder
from evimo.formats.evt3_messages import Evt3Messages


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
    return joined([*(decoder.decoded(ros2_packet(raw)) for (raw,) in messages), decoder.rest()])


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


def test_a_damaged_libcaer_time_costs_itself():
    lows = [5, 9, 2**31 - 7, 12, 3, 20]
    packed = b"".join(struct.pack("<II", 1 << 17, low) for low in lows)
    events = PacketDecoder("x").decoded(EventPacket((48, 64), 0, "libcaer", memoryview(packed)))
    assert events.t[[0, 1, 3, 4, 5]].tolist() == [5, 9, 12, 3, 20]


@pytest.mark.parametrize("count", [0, 1, 2, 3, 500])
@pytest.mark.parametrize("cdr", [False, True])
@pytest.mark.parametrize("frame", [b"", b"c", b"camera"])
def test_events_of_arrays_lie_where_their_numbers_are_aligned(count, cdr, frame):
    """Each field as the middleware puts it, one by one; the message begins at any byte of a chunk."""
    draw = np.random.default_rng(count)
    events = draw.integers(0, (65_536, 65_536, 1 << 32, 1_000_000_000, 2), (count, 5))
    stored = bytearray(b"\0\1\0\0" if cdr else bytes(4))
    fields = [
        ("I", 7),
        ("I", 8),
        ("I", len(frame)),
        *(("B", byte) for byte in frame),
        *(("I", n) for n in (48, 64, count)),
    ]
    for form, value in [*fields, *(field for event in events.tolist() for field in zip("HHIIB", event, strict=True))]:
        stored += bytes(-len(stored) % struct.calcsize(form) if cdr else 0) + struct.pack("<" + form, value)
    for odd in range(4):
        message = memoryview(bytes(odd) + stored)[odd:]
        found = ArrayDecoder(cdr=cdr)(message, 0)
        assert np.array_equal(np.stack([found.x, found.y], axis=1), events[:, :2])
        assert np.array_equal(found.t, events[:, 2] * 1_000_000 + (events[:, 3] + 500) // 1000)
        assert np.array_equal(found.p, 2 * events[:, 4] - 1)


def evt3_words(*codes):
    return np.array([kind << 12 | value for kind, value in codes], np.uint16)


@pytest.mark.parametrize("together", [1, 100, 1 << 18])
def test_evt3_is_the_same_however_it_is_cut_into_messages(some_events, encoded, rows, monkeypatch, together):
    monkeypatch.setattr(evt3_messages, "TOGETHER", together)
    events = some_events(600, span_us=40_000)
    stream, _ = encoded.evt3(events)
    for seed in range(20):
        cuts = np.sort(np.random.default_rng(seed).integers(0, len(stream), seed))
        decode = Evt3Messages()
        parts = [decode(part, 0) for part in np.split(stream, cuts)]
        assert rows([*parts, decode.rest()]) == rows([events])


def test_messages_that_wait_do_not_hold_what_was_packed_with_them():
    """A view of a message would keep the bag's whole chunk, pictures and all, until enough words are there."""
    chunk = bytearray(evt3_words((8, 1), (6, 2), (0, 1), (2, 1)).tobytes())
    decode = Evt3Messages()
    decode(np.frombuffer(chunk, "<u2"), 0)
    chunk.clear()  # refused while anything shows it
    assert decode.rest().t.tolist() == [1 << 12 | 2]


def test_a_damaged_time_in_one_message_is_told_by_the_next(some_events, encoded, rows):
    """The only TIME HIGH of a message is damaged: the message is lost, what comes after is not."""
    events = some_events(400, span_us=40 << 12)
    parts = [events.between(k << 12, (k + 1) << 12) for k in range(40)]
    messages = [encoded.evt3(part)[0] for part in parts]
    messages[20][0] ^= 1 << 9
    decode = Evt3Messages()
    found = [*(decode(message, 0) for message in messages), decode.rest()]
    assert rows(found) == rows(parts[:20] + parts[21:])
    assert sum(packet.lost for packet in found) == len(parts[20])


def test_a_pause_longer_than_the_evt3_clock_is_counted_by_the_times_of_messages():
    def message(t_us):
        return evt3_words((8, t_us >> 12 & 0xFFF), (6, t_us & 0xFFF), (0, 1), (2, 1))

    times = [3_000_000, 3_010_000, 63_000_000, 63_010_000]
    decode = Evt3Messages()
    found = [*(decode(message(t), t + 200) for t in times), decode.rest()]
    assert [t for packet in found for t in packet.t.tolist()] == times


def test_libcaer_cmp_words_by_hand():
    """A message stands for itself: time and column begin anew; the high part of the time sets the low one aside."""
    stream = evt3_words(
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
