"""What every reader promises, on a reader made of arrays."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evimo.errors import BadFile, EvimoWarning
from evimo.events.events import Events
from evimo.formats.event_file import EventFile, camera_of_matrix, found_camera
from evimo.geometry.camera import Camera


def packet(times, x=0, y=0):
    n = len(times)
    columns = np.broadcast_to(np.array(x, np.uint16), n), np.broadcast_to(np.array(y, np.uint16), n)
    return Events(*columns, np.array(times, np.int64), np.ones(n, np.int8))


def recording(*packets, start=0, stop=100):
    return EventFile(
        path=Path("made.up"),
        format="made up",
        sensor=(48, 64),
        start_us=start,
        stop_us=stop,
        read=lambda _: iter(packets),
    )


def test_iterating_gives_all_packets_and_leaves_empty_ones_out(rows):
    made = recording(packet([1, 2]), packet([]), packet([5]))
    assert [row[2] for row in rows(made)] == [1, 2, 5]
    assert all(len(part) for part in made)


def test_packets_are_cut_to_the_half_open_span(rows):
    made = recording(packet([1, 2, 3]), packet([3, 4, 9]))
    assert [row[2] for row in rows(made.packets(2, 4))] == [2, 3, 3]


def test_reading_stops_with_the_span():
    def endless():
        for at in range(0, 10**12, 10_000):
            yield packet([at])

    made = EventFile(path=Path("x"), format="x", sensor=(48, 64), start_us=0, stop_us=10**12, read=lambda _: endless())
    assert [t for part in made.packets(0, 50_000) for t in part.t] == [0, 10_000, 20_000, 30_000, 40_000]


def test_disorder_is_sorted_with_one_warning(rows):
    made = recording(packet([1, 5, 3]), packet([4, 6]))
    with pytest.warns(EvimoWarning, match="2 events were out of order and sorted") as caught:
        assert [row[2] for row in rows(made)] == [1, 3, 4, 5, 6]
    assert len(caught) == 1 and made.faults.out_of_order == 2 and made.faults.dropped == 0


def test_events_outside_the_sensor_are_dropped_with_one_warning(rows):
    made = recording(packet([1, 2, 3, 4], x=[63, 64, 0, 0], y=[47, 0, 48, 0]))
    with pytest.warns(EvimoWarning, match="2 events outside the 64x48 sensor were dropped"):
        assert [row[2] for row in rows(made)] == [1, 4]
    assert made.faults.outside == 2


def test_all_faults_come_in_one_warning():
    times = np.arange(0, 400_000, 1000)
    times[10], times[399] = 8_500, 300_000
    made = recording(packet(times), packet([400_000, 401_000], x=[0, 64]), stop=10**6)
    with pytest.warns(EvimoWarning) as caught:
        list(made)
    assert len(caught) == 1 and all(word in str(caught[0].message) for word in ("sorted", "older", "outside"))


def test_a_recording_of_which_nothing_lies_on_the_sensor_is_refused():
    with pytest.raises(BadFile, match="none of 2 events lies on a sensor of 64x48"):
        list(recording(packet([1, 2], x=64)))


def test_faults_count_one_pass():
    made = recording(packet([2, 1]))
    for _ in range(2):
        with pytest.warns(EvimoWarning):
            list(made)
    assert made.faults.out_of_order == 1


@given(st.lists(st.lists(st.integers(0, 99), max_size=9), max_size=9))
@pytest.mark.filterwarnings("ignore::evimo.errors.EvimoWarning")
def test_what_comes_out_is_sorted_and_nothing_is_lost_uncounted(times):
    made = recording(*map(packet, times))
    try:
        seen = [t for part in made for t in part.t.tolist()]
    except BadFile:
        return
    assert seen == sorted(seen)
    assert len(seen) + made.faults.dropped == sum(map(len, times))


def test_a_matrix_of_zeros_is_no_camera():
    assert camera_of_matrix(np.zeros((3, 3)), (48, 64)) is None
    matrix = np.array([[50.0, 0, 31], [0, 51, 23], [0, 0, 1]])
    assert camera_of_matrix(matrix, (48, 64)) == Camera(50.0, 51.0, 31.0, 23.0, 48, 64)


@pytest.mark.parametrize("matrix", [np.eye(4), np.diag([-50.0, 50, 1]), np.diag([np.nan, 50, 1])])
def test_intrinsics_that_are_no_camera_are_ignored_with_a_warning(matrix):
    with pytest.warns(EvimoWarning, match="the intrinsics in K of a.npz are ignored"):
        assert found_camera(lambda: camera_of_matrix(matrix, (48, 64)), "K of a.npz") is None


def test_most_events_outside_are_no_fault_of_a_part():
    """A burst of wrong pixels fills the part that is read, not the recording."""
    burst, others = packet(np.arange(300) % 20, x=200), packet(np.arange(20, 400))
    made = recording(burst, packet([19]), others, stop=400)
    with pytest.warns(EvimoWarning, match="300 events outside"):
        assert sum(map(len, made.packets(0, 20))) == 1
    with pytest.warns(EvimoWarning, match="300 events outside"):
        assert sum(map(len, made)) == 381
    with pytest.raises(BadFile, match="300 of 320 events lie outside"):
        list(recording(burst, packet(np.arange(20, 40)), stop=40))
