"""Events in memory as a recording."""

import numpy as np
import pytest

from evimo.errors import BadInput, EvimoWarning
from evimo.events.events import Events, joined
from evimo.formats.in_memory import PACKET, recording_of

ROWS = np.array([[1000, 3, 4, 1], [1010, 30, 40, 0], [1010, 63, 47, 1], [26_000, 0, 0, 0]])  # t x y p
FIELDS = [("t", "i8"), ("x", "u2"), ("y", "u2")]


def structured(name, kind):
    array = np.zeros(len(ROWS), [*FIELDS, (name, kind)])
    array["t"], array["x"], array["y"], array[name] = ROWS.T
    return array


def as_events():
    t, x, y, p = ROWS.T
    return Events(x.astype(np.uint16), y.astype(np.uint16), t.astype(np.int64), (2 * p - 1).astype(np.int8))


@pytest.mark.parametrize(
    "given",
    [
        ROWS,
        ROWS.astype(float),
        ROWS.astype(np.uint32),
        np.where(ROWS == 0, [[0, 0, 0, -1]], ROWS),
        as_events(),
        structured("p", "i1"),
        structured("polarity", "?"),
        structured("on", "u1"),
    ],
    ids=["whole", "float", "unsigned", "minus one", "Events", "p", "polarity", "on"],
)
def test_every_way_to_hold_them_gives_the_same_events(given):
    recording = recording_of(given, sensor=(48, 64))
    assert (recording.sensor, recording.start_us, recording.stop_us) == ((48, 64), 1000, 26_001)
    events = joined(list(recording))
    assert (events.x.dtype, events.t.dtype, events.p.dtype) == (np.uint16, np.int64, np.int8)
    assert np.stack((events.t, events.x, events.y), 1).tolist() == ROWS[:, :3].tolist()
    assert events.p.tolist() == [1, -1, 1, -1]


def test_packets_are_small_and_seeking_starts_where_it_should():
    t = np.arange(3 * PACKET)
    recording = recording_of(np.stack((t, t % 60, t % 40, t % 2), 1), sensor=(48, 64))
    assert [len(packet) for packet in recording] == [PACKET] * 3
    part = joined(list(recording.packets(PACKET + 5, PACKET + 9)))
    assert part.t.tolist() == [PACKET + 5, PACKET + 6, PACKET + 7, PACKET + 8]


def test_a_size_that_nobody_gave_is_guessed_and_said():
    with pytest.warns(EvimoWarning, match="events in memory does not tell its sensor's size: taken as 128x128"):
        assert recording_of(ROWS).sensor == (128, 128)


def test_disorder_is_sorted_and_said():
    with pytest.warns(EvimoWarning, match="2 events were out of order"):
        recording = recording_of(ROWS[[3, 0, 1]], sensor=(48, 64))
    events = joined(list(recording))
    assert (events.t.tolist(), events.x.tolist()) == ([1000, 1010, 26_000], [3, 30, 0])


def changed(column, value):
    rows = ROWS.astype(float)
    rows[1, column] = value
    return rows


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (changed(0, 1010.5), r"column t holds 1010.5 at place 1 \(1 of 4 such values\).*\n.*seconds times 1e6"),
        (ROWS * [1e-6, 1, 1, 1], "column t holds 0.001 at place 0"),
        (changed(0, np.nan), "column t holds nan"),
        (changed(0, -1), "column t holds -1.0"),
        (changed(0, 1e19), r"column t holds 1e\+19"),
        (changed(0, 2.0**62), r"column t holds 4\.6\d+e\+18"),
        ((ROWS + [2**25, 0, 0, 0]).astype(np.float32), "column t is float32, .* beyond 16,777,216\n.*int64 or float64"),
        (changed(0, 2049).astype(np.float16), "column t is float16, .* beyond 2,048"),
        (changed(1, 65_536), "column x holds 65536.0"),
        (changed(2, np.inf), "column y holds inf"),
        (changed(3, 2), "column p holds 2.0"),
        (changed(3, np.nan), "column p holds nan"),
        (ROWS.T[:, :3], r"ndarray \(4, 3\) holds no events"),
        (ROWS[:0], "there are no events"),
        (np.array(["a"]), r"ndarray \(1,\) holds no events"),
        (np.zeros(2, [("t", "i8"), ("x", "u2"), ("y", "u2")]), "fields t, x, y holds no events"),
        ([1, 2, 3], "list holds no events"),
        (np.ma.masked_equal(ROWS, ROWS[0, 0]), "some values of the events are masked"),
        (None, "NoneType holds no events"),
        (Events(np.zeros(2, "u2"), np.zeros(3, "u2"), np.arange(2), np.ones(2, "i1")), "do not fit together"),
        (Events(np.zeros((2, 2), "u2"), *(np.zeros((2, 2), "i8"),) * 3), "do not fit together"),
        (Events(np.zeros(2, "u2"), np.zeros(2, "u2"), np.array(["a", "b"]), np.ones(2, "i1")), "column t .* is <U1"),
    ],
)
def test_what_is_not_events_is_one_clear_error(given, said):
    with pytest.raises(BadInput, match=said):
        recording_of(given, sensor=(48, 64))


@pytest.mark.parametrize(("sensor", "turned"), [((47, 64), False), ((48, 63), False), ((64, 48), True)])
def test_events_beyond_the_sensor_are_refused(sensor, turned):
    with pytest.raises(BadInput, match="column 63 and row 47, beyond a sensor of") as raised:
        recording_of(ROWS, sensor=sensor)
    assert raised.value.fix.endswith("sizes are (height, width)") == turned


@pytest.mark.parametrize(
    ("factor", "offset", "is_said"), [(1, 0, False), (1, 10**12, False), (10**6, 0, True), (1, 10**18, True)]
)
def test_times_of_no_camera_are_said(recwarn, factor, offset, is_said):
    """Two events per second and pixel; one in six days; ns since 1970 as µs, in the year 33,000."""
    rng = np.random.default_rng(0)
    t = np.sort(rng.integers(0, 100_000, 600)) * factor + offset
    rows = np.stack((t, rng.integers(0, 64, 600), rng.integers(0, 48, 600), rng.integers(0, 2, 600)), 1)
    recording_of(rows, sensor=(48, 64))
    assert any("are their times in µs?" in str(each.message) for each in recwarn) == is_said


def test_nothing_is_copied_that_need_not_be():
    events = as_events()
    (packet,) = recording_of(events, sensor=(48, 64))
    assert np.shares_memory(packet.t, events.t)
