"""The known world: a wall whose dots move one pixel to the right per slice, a box whose dots move one to the left."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch

from evimo.events.slices import SLICE_US
from evimo.model.ecn import Ecn
from evimo.model.motion_net import MotionNet
from evimo.model.presets import PRESETS, EcnConfig
from evimo.recordings.prepared import SUBPIXEL, Prepared
from evimo.training import data
from evimo.training.data import Samples, samples_of

SLICES_PER_S = 40
WALL_M, BOX_M = 2.0, 1.0


@pytest.fixture(autouse=True, scope="session")
def one_thread() -> None:
    torch.set_num_threads(1)


def dots(
    slices: int, size: tuple[int, int], rng: np.random.Generator, *, with_box: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Signs of dots (S, H, W), at most one per pixel, and the pixels of the box (S, H, W), at the slices' centres."""
    height, width = size
    wall, box = (rng.choice((-1, 0, 1), size=size, p=(0.15, 0.7, 0.15)) for _ in range(2))
    inside = np.zeros((slices, height, width), bool)
    for k in range(slices if with_box else 0):
        left = width // 2 - k
        inside[k, height // 3 : 2 * height // 3, left : left + width // 3] = True
    rolled = [np.where(inside[k], np.roll(box, -k, axis=1), np.roll(wall, k, axis=1)) for k in range(slices)]
    return np.stack(rolled), inside


def known_recording(size: tuple[int, int], slices: int, seed: int, *, with_box: bool) -> Prepared:
    """The known world, prepared; the camera moves along x, the box too, and events lie where their dots are by then."""
    rng = np.random.default_rng(seed)
    height, width = size
    focal_px = 0.75 * width
    signs, box = dots(slices, size, rng, with_box=with_box)
    number, row, column = np.nonzero(signs)  # sorted by slice
    t_us = rng.integers(0, SLICE_US, len(number))
    way = np.where(box[number, row, column], -1, 1)
    x = (column + way * (t_us / SLICE_US - 0.5)).clip(0, width - 1)
    speed = SLICES_PER_S / focal_px  # of one px per slice, 1/s on the plane Z = 1
    velocity = np.zeros((slices, 256, 3), np.float32)
    velocity[:, 1, 0] = -WALL_M * speed - BOX_M * speed
    flow = np.zeros((slices, 2, *size), np.float16)
    flow[:, 0] = np.where(box, -speed, speed)
    return Prepared(
        intrinsics=np.array((focal_px, focal_px, (width - 1) / 2 + 0.3, (height - 1) / 2), np.float32),
        valid=np.ones(size, bool),
        depth=np.where(box, BOX_M, WALL_M).astype(np.float16),
        ids=box.astype(np.uint8),
        moving=box,
        clutter=np.zeros_like(box),
        flow=flow,
        velocity=velocity,
        ego=np.tile(np.array((-WALL_M * speed, 0, 0, 0, 0, 0), np.float32), (slices, 1)),
        event_xy=np.round(np.stack((x, row), axis=1) * SUBPIXEL).astype(np.uint16),
        event_t=t_us.astype(np.uint16),
        event_on=signs[number, row, column] > 0,
        event_first=np.searchsorted(number, np.arange(slices + 1)),
    )


@pytest.fixture
def recording() -> Callable[..., Prepared]:
    """Makes a known world of a size, a number of slices and a seed; without its box nothing moves but the camera."""

    def made(size: tuple[int, int] = (36, 54), slices: int = 7, seed: int = 0, *, with_box: bool = True) -> Prepared:
        return known_recording(size, slices, seed, with_box=with_box)

    return made


@pytest.fixture
def without_events() -> Callable[[Prepared], Prepared]:
    """Takes the events out of a recording."""

    def made(recording: Prepared) -> Prepared:
        gone = {name: getattr(recording, name)[:0] for name in ("event_xy", "event_t", "event_on")}
        return replace(recording, **gone, event_first=np.zeros_like(recording.event_first))

    return made


@pytest.fixture
def small_crops(monkeypatch) -> None:
    """Crops of 64x64 px, so that a step of training takes little time."""
    monkeypatch.setattr(data, "CROP", (64, 64))


@pytest.fixture
def samples(recording) -> Samples:
    """Two known worlds of 36x54 px, smaller than a crop, and 7 slices each."""
    return samples_of([recording(seed=0), recording(seed=1)])


@pytest.fixture
def tiny() -> Callable[[int], MotionNet]:
    """Makes an untrained tiny model from a seed."""

    def made(seed: int = 0) -> MotionNet:
        with torch.random.fork_rng():
            torch.manual_seed(seed)
            return MotionNet(PRESETS["tiny"])

    return made


@pytest.fixture
def ecn() -> Callable[..., Ecn]:
    """Makes an untrained rival, the paper's, from a seed."""

    def made(seed: int = 0, **shape: int) -> Ecn:
        with torch.random.fork_rng():
            torch.manual_seed(seed)
            return Ecn(EcnConfig(**shape))

    return made
