"""Slices: a grid fixed to the file's own clock, whatever the packets look like."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import evimo.events.slices as slices_module
from evimo.errors import BadFile, BadInput
from evimo.events.events import Events, joined, no_events
from evimo.events.slices import SLICE_US, in_slices, in_stacks

FAR = 2**62
HOUR_US = 3_600_000_000


def events_at(times):
    """Events whose column is their rank, so that none can be mistaken for another."""
    t = np.array(times, np.int64)
    rank = (np.arange(len(t)) % 65_536).astype(np.uint16)
    return Events(rank, rank, t, np.ones(len(t), np.int8))


def contents(slices):
    return [(each.index, each.events.t.tolist(), each.events.x.tolist()) for each in slices]


def test_the_docstring_s_example():
    events = events_at([12, 18, 35, 40, 41])
    expected = [(1, [12, 18], [0, 1]), (2, [], []), (3, [35], [2])]
    assert contents(in_slices([events], 10)) == expected
    assert contents(in_slices([events], 10, stop_us=50)) == [*expected, (4, [40, 41], [3, 4])]
    assert contents(in_slices([events], 10, stop_us=49)) == expected


def test_convention_intervals_are_half_open_and_on_the_file_s_grid():
    (first, second) = in_slices([events_at([-25_000, -1, 0, 24_999, 25_000])])
    assert (first.index, first.start_us, first.stop_us, first.centre_us) == (-1, -25_000, 0, -12_500)
    assert (second.index, second.start_us, second.stop_us) == (0, 0, SLICE_US)
    assert first.events.t.tolist() == [-25_000, -1]
    assert second.events.t.tolist() == [0, 24_999]


def test_a_slice_is_finished_by_an_event_exactly_at_its_end():
    assert contents(in_slices([events_at([3, 10])], 10)) == [(0, [3], [0])]
    assert contents(in_slices([events_at([3, 9])], 10)) == []


@given(
    times=st.lists(st.integers(0, 300), min_size=1, max_size=60).map(sorted),
    cuts=st.lists(st.integers(0, 60), max_size=10).map(sorted),
    origin=st.sampled_from([0, -150, -FAR, FAR, 1_700_000_000_000_000]),
    dt_us=st.integers(1, 40),
)
@settings(deadline=None)
def test_slices_do_not_depend_on_how_packets_arrive(times, cuts, origin, dt_us):
    whole = events_at([origin + each for each in times])
    parts = [whole.part(first, last) for first, last in pairwise([0, *cuts, 60])]
    slices = list(in_slices(parts, dt_us))
    assert contents(slices) == contents(in_slices([whole], dt_us))
    first = (origin + times[0]) // dt_us
    last = (origin + times[-1]) // dt_us  # Python's integers: no overflow, and rounded down below zero too
    assert [each.index for each in slices] == list(range(first, last))
    for each in slices:
        inside = [t for t in whole.t.tolist() if t // dt_us == each.index]
        assert each.events.t.tolist() == inside
    assert joined([each.events for each in slices]).x.tolist() == whole.x.tolist()[: sum(len(s.events) for s in slices)]


@given(start_us=st.integers(0, 300))
def test_start_never_moves_the_grid(start_us):
    whole = events_at(range(0, 400, 7))
    all_slices = contents(in_slices([whole], 25))
    later = in_slices([whole.between(start_us // 25 * 25, 500)], 25, start_us=start_us)
    assert contents(later) == [each for each in all_slices if each[0] >= start_us // 25]


def test_start_in_silence_gives_empty_slices_first():
    assert contents(in_slices([events_at([77, 90])], 10, start_us=55)) == [
        (5, [], []),
        (6, [], []),
        (7, [77], [0]),
        (8, [], []),
    ]


def test_empty_packets_and_no_packets():
    assert contents(in_slices([])) == []
    assert contents(in_slices([no_events()], stop_us=100_000)) == []
    assert contents(in_slices([no_events(), events_at([1]), no_events(), events_at([11])], 10)) == [(0, [1], [0])]
    assert contents(in_slices([], 10, start_us=5, stop_us=25)) == [(0, [], []), (1, [], [])]


def test_slices_within_one_packet_are_views():
    packet = events_at(range(100))
    assert all(np.shares_memory(each.events.t, packet.t) for each in in_slices([packet], 10))


def test_slices_come_as_soon_as_they_are_finished():
    def packets():
        yield events_at([1, 11])
        raise AssertionError("asked for more than needed")

    assert next(in_slices(packets(), 10)).index == 0


@pytest.mark.parametrize(
    "times",
    [[[0, HOUR_US + 1]], [[0], [HOUR_US + 1]], [[-FAR - 5, FAR]], [[5, 6, 7, FAR]], [[0, 1], [2, 3, HOUR_US * 9]]],
    ids=str,
)
def test_a_silence_of_more_than_an_hour_is_a_broken_clock(times):
    with pytest.raises(BadFile, match="no events for"):
        list(in_slices([events_at(each) for each in times]))


def test_a_silence_before_the_end_is_limited_too():
    with pytest.raises(BadFile, match="no events for"):
        list(in_slices([events_at([0])], stop_us=FAR))


def test_a_silence_of_a_minute_is_kept():
    slices = list(in_slices([events_at([0, 60_000_000])]))
    assert len(slices) == 2400
    assert [len(each.events) for each in slices[:3]] == [1, 0, 0]


def test_time_that_goes_back_is_refused():
    with pytest.raises(BadFile, match="time goes back"):
        list(in_slices([events_at([10, 20]), events_at([15, 30])], 10))


def test_no_length_is_refused():
    with pytest.raises(BadInput):
        list(in_slices([], 0))


@pytest.mark.parametrize("size", [1, 7, 2000])
@pytest.mark.parametrize("dt_us", [10, 3000, 10**6])
def test_time_is_linear_as_no_event_is_copied_twice(monkeypatch, size, dt_us):
    copied = []

    def counting(packets):
        copied.append(sum(map(len, packets)))
        return joined(packets)

    monkeypatch.setattr(slices_module, "joined", counting)
    whole = events_at(np.arange(2000) * 5)
    count = sum(1 for _ in in_slices([whole.part(first, first + size) for first in range(0, 2000, size)], dt_us))
    assert count == len(copied) == 9995 // dt_us
    assert sum(copied) <= 2000


@pytest.mark.parametrize("count", [0, 1, 2, 3, 5, 30])
@pytest.mark.parametrize("length", [1, 3, 5])
def test_every_item_is_the_middle_of_one_stack_and_missing_neighbours_are_nothing(count, length):
    half = length // 2
    expected = [tuple(n if 0 <= n < count else None for n in range(k - half, k + half + 1)) for k in range(count)]
    assert list(in_stacks(range(count), None, length=length)) == expected


def test_stacks_lag_by_no_more_than_half_their_length():
    asked = []

    def items():
        for each in range(10):
            asked.append(each)
            yield each

    assert [(stack[2], asked[-1]) for stack in in_stacks(items(), -1)][:8] == [(k, k + 2) for k in range(8)]


def test_a_stack_has_a_middle():
    with pytest.raises(BadInput, match="no middle"):
        next(in_stacks([], None, length=4))
