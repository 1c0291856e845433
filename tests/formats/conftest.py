"""Recordings written by other means than the readers', for their tests."""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from evimo.events.events import Events


@pytest.fixture
def events():
    """A thousand sorted events of a 64x48 sensor, several in the same microsecond, both corners included."""
    return some_events(1000)


def some_events(count, *, seed=0, span_us=200_000):
    draw = np.random.default_rng(seed)
    x, y = draw.integers(0, 64, count), draw.integers(0, 48, count)
    x[:2], y[:2] = (0, 63), (0, 47)
    t = np.sort(draw.integers(0, span_us, count))
    return Events(x.astype(np.uint16), y.astype(np.uint16), t, draw.choice([-1, 1], count).astype(np.int8))


def rows(packets):
    """(x, y, t, p) of every event, to be compared as a whole."""
    return [
        row
        for packet in packets
        for row in zip(packet.x.tolist(), packet.y.tolist(), packet.t.tolist(), packet.p.tolist(), strict=True)
    ]


@pytest.fixture(name="rows")
def _rows():
    return rows


@pytest.fixture(scope="session")
def ros2():
    """The functions of ros2_bags.py, which write bags."""
    spec = spec_from_file_location("ros2_bags", Path(__file__).with_name("ros2_bags.py"))
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def encoded():
    """Encoders of Prophesee's words."""
    return SimpleNamespace(evt2=evt2, evt21=evt21, evt3=evt3)


@pytest.fixture(name="some_events")
def _some_events():
    return some_events


def evt2(events):
    """EVT 2.0 words, packed one by one from the documentation, and the number of the word of each event."""
    words, places, high = [], [], None
    for x, y, t, p in zip(*columns(events), strict=True):
        if t >> 6 != high:
            high = t >> 6
            words.append(8 << 28 | high & 0xFFFFFFF)
        places.append(len(words))
        words.append((p > 0) << 28 | (t & 63) << 22 | x << 11 | y)
    return np.array(words, "<u4"), np.array(places)


def evt21(events):
    """Pixels of one row, 32 columns and one instant and polarity share a word, as far as they follow each other."""
    words, places, high, last = [], [], None, None
    for x, y, t, p in zip(*columns(events), strict=True):
        if t >> 6 != high:
            high, last = t >> 6, None
            words.append((8 << 28 | high & 0xFFFFFFF) << 32)
        group = (x // 32, y, t, p)
        bit = 1 << x % 32
        if group == last and words[-1] & 0xFFFFFFFF < bit:
            words[-1] |= bit
        else:
            words.append(((p > 0) << 28 | (t & 63) << 22 | x // 32 * 32 << 11 | y) << 32 | bit)
        last = group
        places.append(len(words) - 1)
    return np.array(words, "<u8"), np.array(places)


def evt3(events, *, again_us=None):
    """Single pixels; a TIME HIGH comes where it changes, and again every `again_us` as cameras send it."""
    words, places, high, low, row, said = [], [], None, None, None, 0
    for x, y, t, p in zip(*columns(events), strict=True):
        if t >> 12 != high or (again_us and t >= said + again_us):
            high, low, said = t >> 12, None, t
            words.append(8 << 12 | high & 0xFFF)
        if t & 0xFFF != low:
            low = t & 0xFFF
            words.append(6 << 12 | low)
        if y != row:
            row = y
            words.append(y)
        places.append(len(words))
        words.append(2 << 12 | (p > 0) << 11 | x)
    return np.array(words, "<u2"), np.array(places)


def columns(events):
    return (column.tolist() for column in (events.x, events.y, events.t, events.p))
