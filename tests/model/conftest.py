"""An untrained tiny model, and stacks of random event frames for it."""

from collections.abc import Callable

import pytest
import torch
from torch import Tensor

from evimo.model.motion_net import MotionNet
from evimo.model.presets import PRESETS

Stack = tuple[Tensor, Tensor, Tensor]


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


@pytest.fixture
def stack(rng) -> Callable[[tuple[int, int]], Stack]:
    """Random frames (1, 5, 3, H, W), all pixels valid, and intrinsics, for an image size."""

    def made(size: tuple[int, int]) -> Stack:
        counts = torch.poisson(torch.full((1, 5, 2, *size), 0.3), generator=rng)
        times = torch.rand(1, 5, 1, *size, generator=rng) * (counts.sum(2, keepdim=True) > 0)
        height, width = size
        intrinsics = torch.tensor([[0.8 * width, 0.7 * width, 0.45 * width, 0.55 * height]])
        return torch.cat((counts, times), dim=2), torch.ones(1, 1, *size), intrinsics

    return made
