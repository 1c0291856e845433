"""An untrained tiny model, and what it sees of random events."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
import torch
from torch import Tensor

from evimo.events.local_motion import motion_candidates
from evimo.events.stack import EventStack, plane_fits, voxel_grid
from evimo.model.ecn import Ecn
from evimo.model.first_pass import FirstAnswer
from evimo.model.motion_net import MotionNet, Prediction
from evimo.model.presets import PRESETS, EcnConfig
from evimo.model.second_pass import compensation


class Look(NamedTuple):
    """What both passes see of one stack; as if nothing were to compensate."""

    voxels: Tensor
    fits: Tensor
    candidates: Tensor
    sharp_voxels: Tensor
    valid: Tensor
    intrinsics: Tensor
    rotation: Tensor

    def first(self, model: MotionNet) -> FirstAnswer:
        return model.first(self.voxels, self.fits, self.candidates, self.valid, self.intrinsics, self.rotation)

    def second(self, model: MotionNet) -> list[Prediction]:
        first = self.first(model)
        taken = compensation(first.ego, first.rel_depth, first.flow, self.intrinsics)
        return model.second(self.sharp_voxels, self.fits, self.valid, taken, self.intrinsics, self.rotation)


@pytest.fixture(autouse=True, scope="session")
def one_thread() -> None:
    torch.set_num_threads(1)


@pytest.fixture
def rng() -> torch.Generator:
    return torch.Generator().manual_seed(0)


@pytest.fixture(scope="session")
def tiny() -> MotionNet:
    with torch.random.fork_rng():
        torch.manual_seed(0)
        return MotionNet(PRESETS["tiny"]).eval()


@pytest.fixture(scope="session")
def ecn() -> Ecn:
    with torch.random.fork_rng():
        torch.manual_seed(0)
        return Ecn(EcnConfig()).eval()


@pytest.fixture
def look() -> Callable[..., Look]:
    """What is seen of random events in an image of a size; all pixels are valid, no rotation is known."""
    random = np.random.default_rng(0)

    def made(size: tuple[int, int], *, gone: tuple[int, ...] = ()) -> Look:
        height, width = size
        count = height * width
        x, y = (random.uniform(-0.5, side - 0.5, count).astype(np.float32) for side in (width, height))
        t = random.uniform(-2.5, 2.5, count).astype(np.float32)
        kept = ~np.isin(np.floor(t + 2.5), gone)
        stack = EventStack(x[kept], y[kept], t[kept], random.random(kept.sum()) < 0.5)
        half = height // 2, width // 2
        voxels = voxel_grid(stack, half, step=2)
        images = voxels, plane_fits(stack, half), motion_candidates(voxels), voxel_grid(stack, size)
        return Look(
            *(torch.from_numpy(image)[None] for image in images),
            valid=torch.ones(1, 1, *half),
            intrinsics=torch.tensor([[0.8 * width, 0.7 * width, 0.45 * width, 0.55 * height]]),
            rotation=torch.zeros(1, 4),
        )

    return made
