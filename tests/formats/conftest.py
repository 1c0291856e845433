"""Recordings written by other means than the readers', for their tests."""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

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


@pytest.fixture(name="some_events")
def _some_events():
    return some_events


@pytest.fixture(name="rows")
def _rows():
    return rows


@pytest.fixture(scope="session")
def encoded():
    """The functions of evt_encoders.py, which pack Prophesee's words."""
    return beside("evt_encoders")


@pytest.fixture(scope="session")
def ros2():
    """The functions of ros2_bags.py, which write bags."""
    return beside("ros2_bags")


def beside(name):
    spec = spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
