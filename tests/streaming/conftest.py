"""A fake network and recordings made of arrays, in packets of any size."""

from collections.abc import Callable, Iterator, Sequence
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

from evimo.events.events import Events
from evimo.events.gyroscope import Gyroscope
from evimo.formats.event_file import EventFile, no_gyroscope
from evimo.geometry.camera import Camera

SENSOR = (24, 32)
START_US = 1_000_012_345  # far from zero and off the grid


@pytest.fixture(scope="session")
def make_fake_network() -> Callable[..., Path]:
    """`save_fake_network` of fake_network.py."""
    spec = spec_from_file_location("fake_network", Path(__file__).with_name("fake_network.py"))
    assert spec and spec.loader
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.save_fake_network


@pytest.fixture(scope="session")
def fake_network(make_fake_network: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Path of the fake network's second pass; the first lies beside it."""
    return make_fake_network(tmp_path_factory.mktemp("model") / "fake.onnx")


@pytest.fixture
def camera() -> Camera:
    return Camera(24.0, 25.0, 15.5, 11.5, *SENSOR)


def two_discs(*, seconds: float = 0.5, seed: int = 0, per_slice: int = 300) -> Events:
    """A disc of ON events that moves right, one of OFF events that moves left below it, over START_US and later."""
    rng = np.random.default_rng(seed)
    count = int(per_slice * seconds * 40)
    t_us = np.sort(rng.integers(0, round(seconds * 1e6), count))
    angle, radius = rng.uniform(0, 2 * np.pi, count), 3 * np.sqrt(rng.uniform(0, 1, count))
    on = rng.random(count) < 0.5
    along = t_us / 1e6 * 20
    x = np.where(on, 6 + along, 25 - along) + radius * np.cos(angle)
    y = np.where(on, 6, 17) + radius * np.sin(angle)
    return Events(
        np.clip(np.rint(x), 0, SENSOR[1] - 1).astype(np.uint16),
        np.clip(np.rint(y), 0, SENSOR[0] - 1).astype(np.uint16),
        START_US + t_us.astype(np.int64),
        np.where(on, 1, -1).astype(np.int8),
    )


def recording_of(
    whole: Events,
    *,
    cuts: Sequence[int] = (),
    sensor: tuple[int, int] = SENSOR,
    read_gyroscope: Callable[[], Gyroscope | None] = no_gyroscope,
) -> EventFile:
    """A recording whose reader hands out the events in packets that end at `cuts`."""

    def read(start_us: int) -> Iterator[Events]:
        for first, last in zip([0, *cuts], [*cuts, len(whole)], strict=True):
            packet = whole.part(first, last)
            if len(packet) and packet.t[-1] >= start_us:
                yield packet

    return EventFile(
        path=Path("made.txt"),
        format="made",
        sensor=sensor,
        start_us=int(whole.t[0]),
        stop_us=int(whole.t[-1]) + 1,
        read=read,
        read_gyroscope=read_gyroscope,
    )


@pytest.fixture
def discs() -> Events:
    """See `two_discs`: half a second."""
    return two_discs()


@pytest.fixture
def recorded() -> Callable[..., EventFile]:
    """`recorded(events, cuts=…, sensor=…, read_gyroscope=…)`: those events as a recording read in packets."""
    return recording_of
