"""A recording small enough to write down."""

import numpy as np
import pytest

from evimo.events.events import Events
from evimo.geometry.camera import Camera
from evimo.recordings.truth import ObjectTruth, Truth

CAMERA = Camera(fx=9.0, fy=9.5, cx=5.6, cy=3.4, height=8, width=12, distortion=(-0.2, 0.05, 0.001, -0.002))


@pytest.fixture
def camera() -> Camera:
    return CAMERA


@pytest.fixture
def pieces() -> list[tuple[Events, Truth]]:
    """Three slices with 50, 0 and 30 events; the second object appears in the last slice only."""
    rng = np.random.default_rng(0)

    def events(number: int, start_us: int) -> Events:
        t = np.sort(rng.integers(start_us, start_us + 25_000, number))
        x, y = rng.integers(0, 12, number).astype(np.uint16), rng.integers(0, 8, number).astype(np.uint16)
        return Events(x, y, t, rng.choice([-1, 1], number).astype(np.int8))

    def truth(k: int) -> Truth:
        depth = rng.uniform(0.3, 4, (8, 12)).astype(np.float32)
        valid = rng.random((8, 12)) > 0.1
        ids = rng.integers(0, 3, (8, 12)).astype(np.uint8) * valid
        objects = {id_: ObjectTruth(*rng.normal(size=(3, 3))) for id_ in ((1,) if k < 2 else (1, 2))}
        return Truth(12_500 + 25_000 * k, depth * valid, valid, ids, (ids == 0) & valid, rng.normal(size=6), objects)

    return [(events(number, 25_000 * k), truth(k)) for k, number in enumerate((50, 0, 30))]
