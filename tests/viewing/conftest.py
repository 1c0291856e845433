"""Estimates and events made by hand."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from evimo.events.events import Events
from evimo.recordings.estimate import Estimate, MovingObject
from evimo.viewing.moment import Mark


def events_at(*pixels: tuple[int, int, int]) -> Events:
    """One event for each (x, y, p), 1 µs apart."""
    x, y, p = np.array(pixels, np.int64).reshape(-1, 3).T
    return Events(x.astype(np.uint16), y.astype(np.uint16), np.arange(len(x)), p.astype(np.int8))


def square(object_id: int, box: tuple[int, int, int, int], velocity: Sequence[float] = (0.0, 0.0, 0.0)) -> MovingObject:
    x0, y0, x1, y1 = box
    area = (x1 - x0 + 1) * (y1 - y0 + 1)
    return MovingObject(object_id, box, area, ((x0 + x1) / 2, (y0 + y1) / 2), 1.0, np.array(velocity, float))


def mark_of(object_id: int, box: tuple[int, int, int, int], velocity: Sequence[float] = (0.0, 0.0, 0.0)) -> Mark:
    one = square(object_id, box)
    return Mark(object_id, box, one.centroid, np.array(velocity, float))


def estimate_of(size: tuple[int, int], *objects: MovingObject, t_us: int = 12_500, **changed: object) -> Estimate:
    """Squares before a wall at depth 1; any field may be given."""
    ids = np.zeros(size, np.uint8)
    for one in objects:
        x0, y0, x1, y1 = one.box
        ids[y0 : y1 + 1, x0 : x1 + 1] = one.id
    fields: dict[str, object] = {
        "t_us": t_us,
        "start_us": t_us - 12_500,
        "stop_us": t_us + 12_500,
        "moving_probability": (ids > 0).astype(np.float32),
        "ids": ids,
        "rel_depth": np.ones(size, np.float32),
        "flow": np.zeros((2, *size), np.float32),
        "confidence": np.ones(size, np.float32),
        "valid": np.ones(size, bool),
        "ego": np.zeros(6),
        "objects": objects,
    }
    return Estimate(**{**fields, **changed})  # type: ignore[arg-type]


@pytest.fixture
def make_events() -> Callable[..., Events]:
    return events_at


@pytest.fixture
def make_square() -> Callable[..., MovingObject]:
    return square


@pytest.fixture
def make_mark() -> Callable[..., Mark]:
    return mark_of


@pytest.fixture
def make_estimate() -> Callable[..., Estimate]:
    return estimate_of
