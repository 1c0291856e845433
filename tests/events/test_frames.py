"""Event frames: grids worked out by hand, sums that must hold, and another way of counting."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array

from evimo.errors import BadInput
from evimo.events.events import Events, no_events
from evimo.events.frames import COUNT_LIMIT, FrameMaker, PixelTable, event_frame, identity_table


def events_of(*rows):
    """Events from (x, y, t, p)."""
    x, y, t, p = np.array(rows, np.int64).reshape(-1, 4).T
    return Events(x.astype(np.uint16), y.astype(np.uint16), t.astype(np.int64), p.astype(np.int8))


def random_events(count, size, generator, *, start_us=0, dt_us=25_000):
    height, width = size
    return Events(
        generator.integers(0, width, count).astype(np.uint16),
        generator.integers(0, height, count).astype(np.uint16),
        np.sort(generator.integers(start_us, start_us + dt_us, count)),
        generator.choice(np.array([-1, 1], np.int8), count),
    )


def shifted_table(height, width, dx, dy, *, out=None):
    x, y, valid, _, _ = identity_table(height, width)
    return PixelTable(x + np.float32(dx), y + np.float32(dy), valid, *(out or (height, width)))


def counted(events, size, start_us, dt_us):
    """The frame without lens by another road: a sparse matrix adds up what falls on the same place."""
    at = (events.y.astype(int), events.x.astype(int))
    positive = coo_array(((events.p > 0).astype(float), at), shape=size).toarray()
    every = coo_array((np.ones(len(events)), at), shape=size).toarray()
    elapsed = coo_array(((events.t - start_us).astype(float), at), shape=size).toarray()
    return np.stack((positive, every - positive, elapsed / np.maximum(every, 1) / dt_us))


def test_a_grid_by_hand():
    events = events_of((1, 0, 100, 1), (1, 0, 105, 1), (1, 0, 109, -1), (2, 1, 102, -1))
    frame = event_frame(events, identity_table(2, 3), start_us=100, dt_us=10)
    assert frame.dtype == np.float32
    assert frame[0].tolist() == [[0, 2, 0], [0, 0, 0]]
    assert frame[1].tolist() == [[0, 1, 0], [0, 0, 1]]
    np.testing.assert_allclose(frame[2], [[0, 14 / 30, 0], [0, 0, 0.2]], rtol=1e-6)


def test_a_splat_by_hand():
    """A pixel lands at (1.25, 0.5): 3/4 to column 1, 1/4 to column 2, half to each row."""
    table = shifted_table(2, 3, 0.25, 0.5)
    frame = event_frame(events_of((1, 0, 4, 1), (1, 0, 8, 1), (1, 0, 6, -1)), table, start_us=0, dt_us=10)
    assert frame[0].tolist() == [[0, 0.75, 0.25], [0, 0.75, 0.25]]
    assert frame[1].tolist() == [[0, 0.375, 0.125], [0, 0.375, 0.125]]
    np.testing.assert_allclose(frame[2], [[0, 0.6, 0.6], [0, 0.6, 0.6]], rtol=1e-6)


def test_times_of_several_events_are_weighted_like_their_counts():
    """Two pixels share column 1: weight 0.75 at time 0.2 and 0.25 at time 0.6 make 0.3."""
    frame = event_frame(events_of((1, 0, 2, 1), (0, 0, 6, 1)), shifted_table(1, 3, 0.25, 0.0), start_us=0, dt_us=10)
    np.testing.assert_allclose(frame[0], [[0.75, 1.0, 0.25]])
    np.testing.assert_allclose(frame[2], [[0.6, 0.3, 0.2]], rtol=1e-6)


def test_convention_x_is_the_column_and_integers_are_pixel_centres():
    frame = event_frame(events_of((3, 1, 0, 1)), identity_table(2, 5), start_us=0)
    assert frame.shape == (3, 2, 5)
    assert frame[0, 1, 3] == 1 and frame.sum() == 1


def test_convention_a_pixel_reaches_half_a_pixel_over_the_border():
    one = events_of((0, 0, 0, 1))
    inside, outside = FrameMaker(shifted_table(1, 2, -0.5, 0.25)), FrameMaker(shifted_table(1, 2, -0.51, 0.0))
    assert inside.frame(one, start_us=0)[0].tolist() == [[1, 0]]
    assert outside.frame(one, start_us=0)[0].tolist() == [[0, 0]]
    assert (inside.dropped, outside.dropped) == (0, 1)


@pytest.mark.parametrize("count", [0, 1, 500, 20_000, COUNT_LIMIT, COUNT_LIMIT + 1, 3 * COUNT_LIMIT])
def test_counts_are_exact_for_any_number_of_events(count):
    events = random_events(count, (6, 7), np.random.default_rng(count), start_us=-7_000)
    frame = event_frame(events, identity_table(6, 7), start_us=-7_000)
    expected = counted(events, (6, 7), -7_000, 25_000)
    assert (frame[:2] == expected[:2]).all()
    np.testing.assert_allclose(frame[2], expected[2], atol=1e-6)


def test_one_pixel_may_get_all_events():
    events = Events(*(np.full(COUNT_LIMIT, n, kind) for n, kind in ((1, "u2"), (0, "u2"), (24_999, "i8"), (-1, "i1"))))
    frame = event_frame(events, identity_table(1, 3), start_us=0)
    assert frame[:2].ravel().tolist() == [0, 0, 0, 0, COUNT_LIMIT, 0]
    assert frame[2, 0, 1] == pytest.approx(24_999 / 25_000)


@pytest.mark.parametrize("dt_us", [1, 1000, 32_768, 40_000, 1_000_000, 3_600_000_000])
def test_mean_time_for_any_length_of_slice(dt_us):
    start_us = 1_700_000_000_000_000
    events = random_events(5000, (4, 4), np.random.default_rng(1), start_us=start_us, dt_us=dt_us)
    frame = event_frame(events, identity_table(4, 4), start_us=start_us, dt_us=dt_us)
    np.testing.assert_allclose(frame[2], counted(events, (4, 4), start_us, dt_us)[2], atol=1 / 16_384)
    assert frame[2].max() <= 1


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(0, 300))
@settings(deadline=None, max_examples=50)
def test_nothing_is_lost_but_what_is_counted(seed, count):
    generator = np.random.default_rng(seed)
    size = (5, 8)
    x, y = generator.uniform(-2, 12, size).astype(np.float32), generator.uniform(-2, 9, size).astype(np.float32)
    table = PixelTable(x, y, generator.random(size) < 0.8, 7, 10)
    events = random_events(count, size, generator)
    maker = FrameMaker(table)
    frame = maker.frame(events, start_us=0)
    px, py = x[events.y, events.x], y[events.y, events.x]
    kept = table.valid[events.y, events.x] & (px >= -0.5) & (px < 9.5) & (py >= -0.5) & (py < 6.5)
    assert (maker.total, maker.dropped) == (count, count - kept.sum())
    np.testing.assert_allclose(frame[0].sum(), (kept & (events.p > 0)).sum(), rtol=1e-5)
    np.testing.assert_allclose(frame[1].sum(), (kept & (events.p < 0)).sum(), rtol=1e-5)
    elapsed = (frame[:2].sum(axis=0) * frame[2]).sum()
    np.testing.assert_allclose(elapsed, events.t[kept].sum() / 25_000, rtol=1e-4)
    assert frame.min() >= 0 and frame[2].max() <= 1


def test_the_splat_keeps_the_centre_of_mass():
    generator = np.random.default_rng(3)
    x, y = np.float32(generator.uniform(1, 8, (4, 4))), np.float32(generator.uniform(1, 5, (4, 4)))
    events = random_events(1000, (4, 4), generator)
    weight = event_frame(events, PixelTable(x, y, np.ones((4, 4), bool), 7, 10), start_us=0)[:2].sum(axis=0)
    rows, columns = np.mgrid[:7, :10]
    assert (weight * columns).sum() / 1000 == pytest.approx(x[events.y, events.x].mean(), rel=1e-5)
    assert (weight * rows).sum() / 1000 == pytest.approx(y[events.y, events.x].mean(), rel=1e-5)


def test_events_off_the_sensor_or_the_slice_are_dropped_and_counted():
    events = events_of(
        (0, 0, 9, 1), (3, 0, 10, 1), (0, 2, 11, 1), (65_535, 65_535, 12, 1), (1, 1, 13, 1), (0, 0, 20, 1)
    )
    for table in (identity_table(2, 3), shifted_table(2, 3, 0.0, 0.25, out=(3, 3))):
        maker = FrameMaker(table)
        assert maker.frame(events, start_us=10, dt_us=10)[0].sum() == 1
        assert (maker.total, maker.dropped) == (6, 5)


def test_invalid_pixels_get_nothing():
    table = identity_table(2, 2)
    table.valid[0, 1] = False
    maker = FrameMaker(table)
    frame = maker.frame(events_of((0, 0, 0, 1), (1, 0, 0, 1), (1, 0, 0, -1)), start_us=0)
    assert frame[0].tolist() == [[1, 0], [0, 0]] and frame[1].sum() == 0
    assert maker.dropped == 2


def test_what_was_in_the_output_does_not_matter():
    for table in (identity_table(4, 4), shifted_table(4, 4, 0.3, 0.0)):
        maker, out = FrameMaker(table), np.full((3, 4, 4), np.nan, np.float32)
        events = random_events(50, (4, 4), np.random.default_rng(0))
        assert maker.frame(events, start_us=0, out=out) is out
        assert (out == event_frame(events, table, start_us=0)).all()
        assert (maker.frame(no_events(), start_us=0, out=out) == 0).all()


@pytest.mark.parametrize("out", [np.zeros((3, 4, 5), np.float32), np.zeros((3, 4, 4)), np.zeros((4, 4, 3), "f4").T])
def test_an_output_that_does_not_fit_is_refused(out):
    with pytest.raises(BadInput):
        event_frame(no_events(), identity_table(4, 4), start_us=0, out=out)


def test_tables_that_cannot_be_are_refused():
    x, y, valid, height, width = identity_table(4, 4)
    for wrong in (PixelTable(x[1:], y, valid, height, width), PixelTable(x, y, valid, 0, width)):
        with pytest.raises(BadInput):
            FrameMaker(wrong)
