"""Statistics of a few events counted by hand, and of random ones counted slowly."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from pytest import approx

from evimo.errors import BadInput
from evimo.evaluation.event_statistics import EventStatistics, count_shares, event_statistics, hot_pixels, shares_up_to
from evimo.events.events import Events
from evimo.formats.event_file import EventFile

Row = tuple[float, int, int, int]
START_US = 1_234_567


def file_of(rows: Sequence[Row], sensor: tuple[int, int], *, packet: int = 1 << 20) -> EventFile:
    """Rows (ms after the start, x, y, polarity), sorted, as a recording that comes in packets of that many events."""
    ms, x, y, p = np.array(rows).T
    t = START_US + np.rint(1000 * ms).astype(np.int64)
    events = Events(x.astype(np.uint16), y.astype(np.uint16), t, p.astype(np.int8))
    parts = [events.part(first, first + packet) for first in range(0, len(t), packet)]
    return EventFile(
        path=Path("made up"),
        format="made up",
        sensor=sensor,
        start_us=int(t[0]),
        stop_us=int(t[-1]) + 1,
        read=lambda _: iter(parts),
    )


FEW = [(0, 0, 0, 1), (2, 0, 0, 1), (6, 0, 0, -1), (15, 3, 2, 1), (30, 3, 2, -1), (38, 4, 3, 1), (50, 0, 0, 1)]


@pytest.fixture
def few() -> EventStatistics:
    """Six events in two slices on 5x4 pixels; the seventh lies in the unfinished third slice."""
    return event_statistics(file_of(FEW, (4, 5)))


def test_counts_are_of_whole_slices_from_the_first_event(few):
    assert (few.slices, few.events, few.per_slice.tolist()) == (2, 6, [4, 2])
    assert few.values["rate"] == approx(6 / (20 * 0.05))
    assert few.values["slice_50"] == approx(3 / 20)


def test_active_pixels_are_counted_per_slice(few):
    assert few.counts[:5].tolist() == [2 * 20 - 4, 3, 0, 1, 0]
    assert few.values["active"] == approx(4 / 40)
    assert few.values["per_active"] == approx(6 / 4)
    assert (few.values["one"], few.values["four"]) == (0.75, 0)
    assert count_shares(few)[:4] == approx([0.75, 0, 0.25, 0])


def test_intervals_are_of_one_pixel_whatever_the_polarity(few):
    """2 and 4 ms in the corner, 15 ms in the middle."""
    assert few.intervals.sum() == 3
    assert [few.values[f"interval_{percent}"] for percent in ("0.1", "25", "50")] == approx([2, 2, 4], rel=0.01)
    assert shares_up_to(few, np.array([1, 3, 5, 14, 16])) == approx([0, 1 / 3, 2 / 3, 2 / 3, 1])
    assert few.values["changes"] == approx(2 / 3)


def test_polarity(few):
    assert few.values["on"] == approx(4 / 6)


def test_an_event_is_isolated_without_company_before_and_after(few):
    """Only that at 15 ms: those in the corner have each other, that at 30 ms gets a neighbour 8 ms later."""
    assert few.values["isolated"] == approx(1 / (20 * (0.05 - 0.02)))


def test_company_is_eight_pixels_around_and_ten_milliseconds():
    def isolated(*others: Row) -> float:
        rows = sorted([(0, 0, 0, 1), (30, 4, 4, 1), (75, 0, 0, 1), *others])
        return round(event_statistics(file_of(rows, (9, 9))).values["isolated"] * 81 * 0.055)

    assert isolated() == 1
    assert (
        isolated((20, 4, 4, -1)) == isolated((40, 4, 4, 1)) == isolated((40, 3, 5, 1)) == isolated((20, 5, 3, 1)) == 0
    )
    assert isolated((19.999, 4, 4, 1)) == isolated((40.001, 4, 4, 1)) == 2
    assert isolated((31, 4, 6, 1)) == 2


def random_rows(number: int, *, seed: int, ms: int, side: int) -> list[Row]:
    """Events at whole milliseconds, some in bursts; the first at 0, the last just after the end."""
    rng = np.random.default_rng(seed)
    times = np.sort(rng.integers(0, ms, number))
    rows = [(int(t), *rng.integers(0, side, 2).tolist(), int(rng.choice([-1, 1]))) for t in times]
    return [(0, 0, 0, 1), *rows, (ms, 0, 0, 1)]


def slowly(rows: list[Row], *, ms: int, side: int) -> dict[str, float]:
    """Isolated events, quiet seconds and polarity changes, by looking at everything for everything."""
    rows = [row for row in rows if row[0] < ms]

    def near(x: int, y: int, t: float) -> list[Row]:
        return [row for row in rows if abs(row[1] - x) <= 1 and abs(row[2] - y) <= 1 and abs(row[0] - t) <= 10]

    isolated = sum(len(near(x, y, t)) == 1 and 10 <= t <= ms - 10 for t, x, y, _ in rows)
    instants = [at + 0.5 for at in range(10, ms - 10)]
    quiet_ms = sum(not near(x, y, at) for x in range(side) for y in range(side) for at in instants)
    trains = [[p for _, x, y, p in rows if (x, y) == (u, v)] for u in range(side) for v in range(side)]
    changes = sum(a != b for train in trains for a, b in pairwise(train))
    pairs = sum(max(len(train) - 1, 0) for train in trains)
    judged_s = (ms - 20) * 1e-3
    return {
        "isolated": isolated / (side**2 * judged_s),
        "quiet": isolated / (quiet_ms * 1e-3),
        "changes": changes / pairs,
    }


@pytest.mark.parametrize("packet", [1, 7, 1000])
@pytest.mark.parametrize("seed", [0, 1])
def test_random_events_give_what_slow_counting_gives(seed, packet):
    rows = random_rows(60, seed=seed, ms=150, side=7)
    values = event_statistics(file_of(rows, (7, 7), packet=packet)).values
    assert {name: values[name] for name in ("isolated", "quiet", "changes")} == approx(slowly(rows, ms=150, side=7))


def test_a_hot_pixel_is_counted_and_left_out():
    hot = [(float(at), 2, 2, 1) for at in np.arange(0.5, 100, 0.5)]
    rows = sorted([(0, 0, 0, 1), (50, 3, 3, -1), (60, 3, 3, -1), (100, 0, 0, 1), *hot])
    statistics = event_statistics(file_of(rows, (6, 6)))
    assert statistics.hot_pixels == 1
    assert statistics.values["hot"] == approx(1e6 / 36)
    assert statistics.intervals.sum() == 1
    assert statistics.values["interval_50"] == approx(10, rel=0.01)
    assert statistics.values["on"] == approx(1 / 3)
    assert statistics.values["per_active"] == approx(3 / 2)
    assert statistics.events == len(rows) - 1


def test_a_busy_pixel_among_busy_pixels_is_not_hot():
    totals = np.zeros((5, 5), np.int64)
    totals[0, 0], totals[3, 3] = 60, 60
    totals[3, 4] = 12
    assert np.argwhere(hot_pixels(totals, 1_000_000)).tolist() == [[0, 0]]
    assert not hot_pixels(totals, 10_000_000).any()  # 6 Hz


def test_what_nothing_was_seen_of_is_none():
    statistics = event_statistics(file_of([(0, 0, 0, 1), (25, 0, 0, 1)], (3, 3)))
    assert statistics.slices == 1
    for name in ("interval_0.1", "interval_50", "longer", "changes"):
        assert statistics.values[name] is None
    assert shares_up_to(statistics, np.array([1.0, 100.0])).tolist() == [0, 0]


def test_a_recording_shorter_than_a_slice_is_refused():
    with pytest.raises(BadInput, match=r"made up lasts 24\.9 ms"):
        event_statistics(file_of([(0, 0, 0, 1), (24.9, 0, 0, 1)], (3, 3)))


def test_every_slice_is_reported():
    told: list[None] = []
    event_statistics(file_of(FEW, (4, 5)), advance=lambda: told.append(None))
    assert len(told) == 2
