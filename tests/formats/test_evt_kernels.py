"""Prophesee's words, against words made by hand and encoders of the tests' own; and what a damaged word costs."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
import pytest

from evimo.events.events import Events, joined
from evimo.formats.evt2_kernel import decode_evt2, decode_evt21, evt2_state
from evimo.formats.evt3_kernel import decode_evt3, evt3_state
from evimo.formats.evt_clock_kernel import clock_words


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
    x, y, t, p, _, _ = decode_evt3(stream, evt3_state(0), True)
    assert x.tolist() == [9, 16, 27, 29, 63]
    assert y.tolist() == [40] * 5
    assert t.tolist() == [3 * 4096 + 21] * 4 + [3 * 4096 + 22]
    assert p.tolist() == [1, 1, 1, 1, -1]


def test_evt3_vectors_before_a_base_are_off_from_the_first_column_on():
    x, _, _, p, _, _ = decode_evt3(words((8, 3), (6, 21), (0, 40), (4, 0b101)), evt3_state(0), True)
    assert (x.tolist(), p.tolist()) == ([0, 2], [-1, -1])


def mixed_words(rng, count, *, far=0.0):
    """Words of all kinds in any order under a clock that goes on, and the events that they mean, one by one.

    far: share of bases beyond column 1024, from which vectors may leave the 11 bits of columns.
    """
    codes, events, t, row, base, sign = [(8, 0), (6, 0), (3, 0)], [], 0, 0, 0, -1
    for kind in rng.choice([0, 2, 2, 3, 4, 5, 6, 8, 10, 14], count).tolist():
        value = int(rng.integers(4096))
        if kind == 0:
            row = value & 0x7FF
        elif kind == 2:
            events.append((value & 0x7FF, row, t, 1 if value >> 11 else -1))
        elif kind == 3:
            value = value & 0xBFF | (1 << 10 if rng.random() < far else 0)
            base, sign = value & 0x7FF, 1 if value >> 11 else -1
        elif kind in (4, 5):
            events += [(base + k, row, t, sign) for k in range(12) if value >> k & 1]
            base += 12 if kind == 4 else 8
        elif kind == 6:
            t += int(rng.integers(200))
            codes += [(8, t >> 12)] if t >> 12 != codes_high(codes) else []
            value = t & 0xFFF
        elif kind == 8:
            value = codes_high(codes)  # once more
        codes.append((kind, value))
    return words(*codes), events


def codes_high(codes):
    return next(value for kind, value in reversed(codes) if kind == 8)


@pytest.mark.parametrize("far", [0, 0.05])
@pytest.mark.parametrize("block", [100, 2_000, 1 << 30])
def test_evt3_words_of_all_kinds_are_as_one_by_one(block, far):
    for seed in range(4):
        stream, events = mixed_words(np.random.default_rng(seed), 12_000, far=far)
        found, lost = Kind(None, decode_evt3, partial(evt3_state, 0), 12).decoded(stream, block=block)
        columns = zip(found.x.tolist(), found.y.tolist(), found.t.tolist(), found.p.tolist(), strict=True)
        assert list(columns) == events and lost == 0


def test_evt3_vectors_after_long_without_any_are_as_one_by_one():
    """Blocks and parts of them that hold no vectors are decoded by other code than those that do."""
    draw = np.random.default_rng(0)
    before, (stream, events) = mixed_words(draw, 9_000)[0], mixed_words(draw, 300)
    before = before[np.isin(before >> 12, (0, 2, 3, 10, 14))]  # no vectors, and the clock stands still
    whole = np.concatenate([stream[:3], before, words((0, 0)), stream])
    found, lost = Kind(None, decode_evt3, partial(evt3_state, 0), 12).decoded(whole)
    columns = zip(found.x.tolist(), found.y.tolist(), found.t.tolist(), found.p.tolist(), strict=True)
    assert list(columns)[-len(events) :] == events
    assert (len(found), lost) == (np.count_nonzero(before >> 12 == 2) + len(events), 0)


@pytest.mark.parametrize("kind, shift", [(np.uint16, 12), (np.uint32, 28)])
def test_clock_words_are_found_wherever_they_are(kind, shift):
    """Alone in a part, several in one, at its borders, in the rest that fills none."""
    for seed in range(200):
        draw = np.random.default_rng(seed)
        words = draw.integers(0, np.iinfo(kind).max, draw.choice([0, 1, 127, 128, 129, 256, 1000, 70_000]), kind)
        words[words >> shift == 8] ^= kind(1 << shift)
        chosen = draw.random(len(words)) < draw.choice([0, 0.001, 0.01, 0.5])
        chosen[127::128] |= draw.random(len(chosen[127::128])) < 0.1
        words[chosen] = words[chosen] & kind((1 << shift) - 1) | kind(8 << shift)
        values, places = clock_words(words, kind(shift), kind(8))
        assert np.array_equal(places, np.flatnonzero(chosen))
        assert np.array_equal(values, words[chosen] & kind((1 << shift) - 1))


def test_evt3_clock_wraps_every_24_bits_and_starts_in_the_expected_round():
    stream = words(*((8, 4095), (6, 0), (2, 1)), *((8, 0), (6, 2), (2, 1)), *((8, 1), (6, 3), (2, 1)))
    t = decode_evt3(stream, evt3_state(0), True)[2]
    assert t.tolist() == [4095 << 12, 1 << 24 | 2, 1 << 24 | 1 << 12 | 3]
    later = decode_evt3(stream, evt3_state(5 * (1 << 24) - 3000), True)[2]
    assert (later - t).tolist() == [4 << 24] * 3


@pytest.fixture(params=["evt2", "evt21", "evt3", "evt3, every 256 us"])
def kind(request, encoded):
    """Encoder, decoder, state and the time of a TIME HIGH's unit, of one encoding."""
    again = partial(encoded.evt3, again_us=256)
    return {
        "evt2": Kind(encoded.evt2, decode_evt2, evt2_state, 6),
        "evt21": Kind(encoded.evt21, evt21_words, evt2_state, 6),
        "evt3": Kind(encoded.evt3, decode_evt3, partial(evt3_state, 0), 12),
        "evt3, every 256 us": Kind(again, decode_evt3, partial(evt3_state, 0), 12),
    }[request.param]


class Kind(NamedTuple):
    encode: Callable
    decode: Callable
    state: Callable
    shift: int

    def decoded(self, stream, *, block=1 << 30):
        """All events, and how many are lost, block by block; what a block leaves goes before the next."""
        state, at, lost, parts = self.state(), 0, 0, []
        size = block
        while at < len(stream):
            last = at + size >= len(stream)
            *columns, used, missing = self.decode(stream[at : at + size], state, last)
            parts.append(Events(*columns))
            size = block if used else 2 * size
            at, lost = at + used, lost + missing
        return joined(parts), lost


def evt21_words(stream, state, final):
    return decode_evt21(stream.view("<u4").reshape(-1, 2), state, final, 1)


def row_set(events):
    return set(zip(events.x.tolist(), events.y.tolist(), events.t.tolist(), events.p.tolist(), strict=True))


@pytest.mark.parametrize("span_us", [3_000, 200_000, 40_000_000])
def test_what_was_encoded_is_decoded_whatever_the_blocks(kind, some_events, rows, span_us):
    events = some_events(700, span_us=span_us)
    stream, _ = kind.encode(events)
    for block in (1, 7, 64, 1000, 1 << 30):
        found, lost = kind.decoded(stream, block=block)
        assert rows([found]) == rows([events]) and lost == 0


def test_the_clock_goes_on_where_its_bits_are_full(kind, some_events):
    bits = 24 if kind.shift == 12 else 34
    events = some_events(700, span_us=4_000_000)
    late = Events(events.x, events.y, events.t + (1 << bits) - 2_000_000, events.p)
    found, lost = kind.decoded(kind.encode(late)[0], block=100)
    assert found.t.tolist() == late.t.tolist() and lost == 0


@pytest.mark.parametrize("span_us", [20_000, 200_000, 6_000_000])
def test_one_damaged_word_costs_what_is_beside_it(kind, some_events, span_us):
    """Any word becomes any other: what lies beyond the next words of its kind is as before, in place and time.

    A clock word that now is between the next and the one after may be right, and the next wrong: both may be lost.
    """
    events = some_events(700, span_us=span_us)
    draw = np.random.default_rng(span_us)
    for _ in range(150):
        stream, places = kind.encode(events)
        at = int(draw.integers(len(stream)))
        whole = int(np.iinfo(stream.dtype).max)
        stream[at] ^= (
            1 << int(draw.integers(8 * stream.itemsize))
            if draw.random() < 0.5
            else int(draw.integers(whole, dtype=np.uint64))
        )
        found, lost = kind.decoded(stream, block=int(draw.choice([50, 1 << 30])))
        period = np.cumsum(np.diff(events.t >> kind.shift, prepend=0) != 0)  # between words of the clock
        number = int(np.searchsorted(places, at))
        near = (period >= period[max(number - 1, 0)]) & (period <= period[min(number + 2, 699)] + 1)
        beyond = row_set(Events(*(column[~near] for column in (events.x, events.y, events.t, events.p))))
        assert beyond <= row_set(found)
        assert len(found) + lost >= len(events) - 32


@pytest.mark.parametrize("words_of_noise", [10, 300, 3000])
def test_garbage_costs_what_it_covers(kind, some_events, words_of_noise):
    events = some_events(20_000, span_us=400_000)
    for seed in range(5):
        stream, places = kind.encode(events)
        draw = np.random.default_rng(seed)
        first = int(draw.integers(len(stream) // 4, len(stream) // 2))
        last = first + words_of_noise
        stream[first:last] = draw.integers(0, np.iinfo(stream.dtype).max, words_of_noise, stream.dtype)
        found, _ = kind.decoded(stream, block=1 << 14)
        margin = 40_000 if kind.shift == 12 else 2_000  # µs until the clock is trusted again
        gone = events.t[np.searchsorted(places, first)], events.t[np.searchsorted(places, last)]
        beyond = (events.t < gone[0] - margin) | (events.t > gone[1] + margin)
        kept = Events(*(column[beyond] for column in (events.x, events.y, events.t, events.p)))
        assert row_set(kept) <= row_set(found)
        shifted = (found.t < gone[0] - margin) | (found.t > gone[1] + margin)
        assert np.count_nonzero(shifted) <= len(kept) + 5


def test_a_clock_that_starts_again_goes_back(kind, some_events):
    """What the words say is given; that it is a cut is said where the order of events is looked after."""
    events = some_events(3000, span_us=300_000)
    again = Events(events.x, events.y, events.t + 5_000_000, events.p)
    stream = np.concatenate([kind.encode(again)[0], kind.encode(events)[0]])
    found, lost = kind.decoded(stream, block=5000)
    assert np.array_equal(found.t, np.concatenate([again.t, events.t])) and lost == 0


def test_a_time_high_that_is_missing_is_known_by_the_lower_bits():
    stream = words(
        (8, 5), (6, 100), (0, 1), (2, 1), (6, 4000), (2, 2), (6, 50), (2, 3), (6, 70), (2, 4), (8, 7), (6, 9), (2, 5)
    )
    x, _, t, _, _, lost = decode_evt3(stream, evt3_state(0), True)
    assert (x.tolist(), lost) == ([1, 2, 5], 2)
    assert t.tolist() == [5 << 12 | 100, 5 << 12 | 4000, 7 << 12 | 9]


@pytest.mark.parametrize("lows, kept", [([10, 4000, 20, 30], [0, 2, 3]), ([10, 400, 2, 410], [0, 1, 3])])
def test_a_damaged_time_low_costs_its_own_events(lows, kept):
    stream = words(
        (8, 5), (0, 1), *(word for at, low in enumerate(lows) for word in ((6, low), (2, at))), (8, 6), (6, 1)
    )
    x, _, _, _, _, lost = decode_evt3(stream, evt3_state(0), True)
    assert (x.tolist(), lost) == (kept, 1)


def test_triggers_continuations_and_other_words_carry_no_events(kind, some_events, rows):
    events = some_events(300)
    stream, _ = kind.encode(events)
    top = 8 * stream.itemsize - 4
    others = np.array([code << top | 0x21 for code in (10, 14, 15)], stream.dtype)
    mixed = np.insert(stream, np.arange(0, len(stream), 3), np.resize(others, -(-len(stream) // 3)))
    assert rows([kind.decoded(mixed)[0]]) == rows([events])
