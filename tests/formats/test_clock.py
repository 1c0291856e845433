"""Disorder, outliers and clocks that start again, on recordings made of arrays and cut into packets at random."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evimo.errors import BadFile, EvimoWarning
from evimo.events.events import Events
from evimo.formats.clock import Clock, Faults, sorted_packets
from evimo.formats.event_file import EventFile
from evimo.formats.survey import surveyed

FAR_US = 2**31 - 1


def made_of(times):
    """Events that carry their place in the file as x and y."""
    place = np.arange(len(times))
    return Events(
        (place % 60_000).astype(np.uint16), (place // 60_000).astype(np.uint16), np.array(times, np.int64),
        np.ones(len(times), np.int8),
    )  # fmt: skip


def cut(events, seed, most=5000):
    """The same events in packets of random sizes."""
    draw, at, packets = np.random.default_rng(seed), 0, []
    while at < len(events):
        after = at + int(draw.integers(1, most))
        packets.append(events.part(at, after))
        at = after
    return packets


def read(packets):
    faults = Faults()
    given = list(sorted_packets(iter(packets), Clock(faults)))
    return [t for packet in given for t in packet.t.tolist()], faults


def steady(count=30_000, seed=0, span_us=500_000):
    return np.sort(np.random.default_rng(seed).integers(0, span_us, count))


@pytest.mark.parametrize("seed", range(4))
def test_blocks_sorted_by_pixel_are_sorted_by_time_whatever_the_packets(seed):
    t = steady()
    blocks = np.lexsort((np.random.default_rng(1).random(len(t)), t // 40_000))  # frames of 25 Hz
    found, faults = read(cut(made_of(t[blocks]), seed))
    assert found == t.tolist() and faults.dropped == 0
    assert faults.out_of_order == int((t[blocks] < np.maximum.accumulate(t[blocks])).sum())


def test_events_of_one_time_keep_their_order():
    events = made_of([5, 9, 5, 9, 5] * 40)
    faults = Faults()
    (packet,) = sorted_packets(iter([events]), Clock(faults))
    assert all((np.diff(packet.x[packet.t == t]) > 0).all() for t in (5, 9))


@pytest.mark.parametrize("at", [0, 1, 64, 5_000, 15_000, 29_990, 29_999])
@pytest.mark.parametrize("wrong", [FAR_US, 1643243628737093, -(2**62), 2**62, np.iinfo(np.int64).min])
def test_one_wrong_time_costs_one_event(at, wrong):
    t = 3_000_000 + steady()
    wronged = t.copy()
    wronged[at] = wrong
    for seed in range(3):
        found, faults = read(cut(made_of(wronged), seed))
        assert found == np.delete(t, at).tolist()
        assert faults.dropped == 1


def test_a_zero_among_large_times_costs_one_event():
    t = 3_000_000_000 + steady()
    for at in (0, 64, 20_000, 29_999):
        wronged = t.copy()
        wronged[at] = 0
        found, faults = read(cut(made_of(wronged), at))
        assert found == np.delete(t, at).tolist() and faults.dropped == 1


@given(st.lists(st.integers(100, 29_900), max_size=20, unique=True), st.integers(0, 99))
@settings(deadline=None, max_examples=30)
def test_scattered_wrong_times_cost_themselves(places, seed):
    t = 10**9 + steady()
    wronged = t.copy()
    wronged[places] = np.random.default_rng(seed).integers(-(2**50), 2**50, len(places))
    found, faults = read(cut(made_of(wronged), seed))
    assert found == np.delete(t, places).tolist() and faults.dropped == len(places)


def test_a_late_packet_is_dropped_and_the_rest_goes_on():
    t = steady()
    late = np.concatenate([t[:20_000], t[:3000], t[20_000:]])
    found, faults = read(cut(made_of(late), 0))
    assert found == t.tolist() and (faults.late, faults.after_reset) == (3000, 0)


@pytest.mark.parametrize("ahead_us", [60_000, 500_000, 10**12])
@pytest.mark.parametrize("count", [3, 31, 33, 40, 64, 100, 3000, 8000])
def test_a_block_ahead_of_the_clock_costs_itself(count, ahead_us):
    """As of one message with a wrong stamp; before, all that followed was lost."""
    t = steady(60_000, span_us=4_000_000)
    wronged = t.copy()
    wronged[20_000 : 20_000 + count] += ahead_us + 4_000_000
    kept = np.delete(t, np.s_[20_000 : 20_000 + count])
    for seed in range(2):
        found, faults = read(cut(made_of(wronged), seed))
        assert found == kept.tolist() and faults == Faults(outlying=count)


def test_a_block_ahead_costs_itself_where_reading_begins_before_or_after_it():
    t = steady(60_000, span_us=4_000_000)
    wronged = t.copy()
    wronged[20_000:23_500] += 10**10
    kept = np.delete(t, np.s_[20_000:23_500])
    file = opened(wronged)
    assert (file.start_us, file.stop_us) == (t[0], t[-1] + 1)
    for start in (0, int(t[19_990]), 3_000_000):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", EvimoWarning)
            found = [each for packet in file.packets(start, start + 500_000) for each in packet.t.tolist()]
        assert found == kept[(kept >= start) & (kept < start + 500_000)].tolist()


def test_two_cameras_in_turn_are_refused():
    t = steady(60_000, span_us=4_000_000)
    t[np.arange(60_000) // 2000 % 2 == 1] += 10**9
    with pytest.raises(BadFile, match=r"far from those around them|more than 50 ms older"):
        opened(t)


@pytest.mark.parametrize("second_span_us", [300_000, 5_000_000])
def test_a_clock_that_starts_again_cuts_the_recording_there(second_span_us):
    first, second = steady(), steady(20_000, 1, second_span_us)
    found, faults = read(cut(made_of(np.concatenate([first, second])), 0))
    assert found == first.tolist()
    assert (faults.after_reset, faults.late, faults.reset_us) == (20_000, 0, first[-1])
    assert "its clock starts again after 499" in faults.parts((1, 1))[0]


def test_a_few_events_before_the_clock_starts_are_left_out_rather_than_all_others():
    before, t = 7_000_000 + steady(2000, 1, 30_000), steady()
    found, faults = read(cut(made_of(np.concatenate([before, t])), 0))
    assert found == t.tolist() and faults.outlying == 2000


def test_pauses_are_no_faults():
    t = np.concatenate([steady(1000) + pause for pause in (0, 2_000_000, 90_000_000, 4_000_000_000)])
    found, faults = read(cut(made_of(t), 0))
    assert found == t.tolist() and faults == Faults()
    sparse = np.arange(0, 10**9, 10**7)
    assert read(cut(made_of(sparse), 1, most=3))[0] == sparse.tolist()


def opened(times):
    events = made_of(times)
    survey = surveyed(Path("a.x"), [(at, events.part(at, at + 1000)) for at in range(0, len(events), 1000)])
    return EventFile(
        path=Path("a.x"), format="x", sensor=(9, 60_000), start_us=survey.start_us, stop_us=survey.stop_us,
        read=lambda start: iter([events.part(survey.place(start), len(events))]),
    )  # fmt: skip


@pytest.mark.filterwarnings("ignore::evimo.errors.EvimoWarning")
def test_what_is_said_of_a_recording_is_said_of_the_events_that_are_read():
    t = steady()
    wronged = t.copy()
    wronged[[3, 20_000, 29_998]] = FAR_US, 0, 2**40
    file = opened(wronged)
    assert (file.start_us, file.stop_us) == (t[0], t[-1] + 1)
    kept = np.delete(t, [3, 20_000, 29_998])
    for start, stop in ((0, 10**6), (100_000, 200_000), (299_000, 499_999)):
        found = [each for packet in file.packets(start, stop) for each in packet.t.tolist()]
        assert found == kept[(kept >= start) & (kept < stop)].tolist()


def test_descending_files_are_refused_when_they_are_opened():
    with pytest.raises(BadFile, match="of 30,000 events are more than 50 ms older than events before them"):
        opened(steady()[::-1])


def test_disorder_that_cannot_be_restored_is_refused():
    t = steady()
    blocks = np.lexsort((np.random.default_rng(1).random(len(t)), t // 250_000))
    with pytest.raises(BadFile, match="sort the recording by time"):
        opened(t[blocks])


def test_a_reset_is_said_in_a_warning():
    file = opened(np.concatenate([steady(), steady(1500)]))
    with pytest.warns(EvimoWarning, match=r"the 1,500 events from there on were dropped"):
        assert sum(map(len, file)) == 30_000
