"""A 6x8 world worked out by hand: a mover of 2x3 pixels, clutter of 2x2, a resting object of 1x2."""

from collections.abc import Callable

import numpy as np
import pytest

from evimo.evaluation.labels import LabelledSlice, labelled
from evimo.events.events import Events
from evimo.recordings.truth import ObjectTruth, Truth

SIZE = (6, 8)
FOCAL_PX = (100.0, 100.0)
EGO = np.array([0.4, 0, 0.3, 0, 0, 0.2])  # 0.5 m/s, 0.2 rad/s


def events_at(pixels: list[tuple[int, int]], t_us: int = 12_500) -> Events:
    """One event at each (x, y), in that order."""
    x, y = np.array(pixels, np.uint16).reshape(-1, 2).T
    return Events(x, y, np.full(len(x), t_us, np.int64), np.ones(len(x), np.int8))


def hand_made_truth(velocity: tuple[float, float, float] = (0, 0.2, 0), rotation: float = 0.0) -> Truth:
    """Object 1 at rows 1-2, columns 1-3; object 2 rests at row 5, columns 0-1; clutter at rows 4-5, columns 5-6."""
    ids, clutter = np.zeros(SIZE, np.uint8), np.zeros(SIZE, bool)
    ids[1:3, 1:4] = 1
    ids[5, 0:2] = 2
    clutter[4:6, 5:7] = True
    depth = np.full(SIZE, 2.0, np.float32)
    depth[ids == 1] = 1.0
    still = np.zeros(3)
    objects = {
        1: ObjectTruth(np.array([0, 0, 1.0]), np.array(velocity, float), np.array([0, 0, rotation])),
        2: ObjectTruth(np.array([0, 0, 2.0]), still, still),
    }
    return Truth(12_500, depth, np.ones(SIZE, bool), ids, clutter, EGO, objects)


@pytest.fixture
def sample() -> LabelledSlice:
    """Events: 4 on the mover (3 pixels), 2 on clutter, 1 on the resting object, 3 elsewhere; flow 0.3, 0.4 per s."""
    pixels = [(1, 1), (1, 1), (2, 1), (3, 2), (5, 4), (6, 5), (0, 5), (7, 0), (6, 0), (4, 3)]
    flow = np.stack((np.full(SIZE, 0.3), np.full(SIZE, 0.4))).astype(np.float32)
    return labelled(
        events_at(pixels), hand_made_truth(), scored=np.ones(SIZE, bool), focal_px=FOCAL_PX, dt_s=0.025, flow=flow
    )


@pytest.fixture
def still_sample() -> LabelledSlice:
    """The same world with the mover at rest and four events."""
    truth = hand_made_truth(velocity=(0, 0.02, 0))
    pixels = [(1, 1), (5, 4), (0, 5), (7, 0)]
    return labelled(events_at(pixels), truth, scored=np.ones(SIZE, bool), focal_px=FOCAL_PX, dt_s=0.025)


@pytest.fixture
def box() -> Callable[..., np.ndarray]:
    """A mask that is True in rows y0..y1 and columns x0..x1, ends excluded."""

    def draw(y0: int, y1: int, x0: int, x1: int) -> np.ndarray:
        mask = np.zeros(SIZE, bool)
        mask[y0:y1, x0:x1] = True
        return mask

    return draw


@pytest.fixture
def big_sample() -> LabelledSlice:
    """40x40: object 1 of 20x20 pixels at 1 m moves 0.2 m/s down, object 2 rests; an event on every third pixel."""
    size = (40, 40)
    small = hand_made_truth()
    ids = np.zeros(size, np.uint8)
    ids[10:30, 10:30] = 1
    ids[32:40, 0:8] = 2
    depth = np.where(ids == 1, 1.0, 2.0).astype(np.float32)
    clutter = np.zeros(size, bool)
    clutter[0:8, 30:40] = True
    truth = Truth(12_500, depth, np.ones(size, bool), ids, clutter, small.ego, small.objects)
    events = events_at([(x, y) for y in range(40) for x in range(0, 40, 3)])
    flow = np.full((2, *size), 0.3, np.float32)
    return labelled(events, truth, scored=np.ones(size, bool), focal_px=FOCAL_PX, dt_s=0.025, flow=flow)
