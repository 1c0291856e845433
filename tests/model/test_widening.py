from dataclasses import replace

import pytest
import torch

from evimo.errors import BadInput
from evimo.model.motion_net import MotionNet
from evimo.model.networks import network_of
from evimo.model.presets import PRESETS
from evimo.model.widening import widened


@pytest.fixture
def small():
    with torch.random.fork_rng():
        torch.manual_seed(0)
        model = MotionNet(PRESETS["small"]).eval()
        for part in model.parameters():  # away from zero biases and unit gains
            part.data += 0.02 * torch.randn_like(part)
    return model


def test_a_wider_model_answers_alike(small, look):
    seen = look((small.config.stride, 2 * small.config.stride))
    wide = widened(small, PRESETS["base"]).eval()
    assert sum(each.numel() for each in wide.parameters()) > 2 * sum(each.numel() for each in small.parameters())
    with torch.no_grad():
        for one, other in zip(seen.first(small), seen.first(wide), strict=True):
            torch.testing.assert_close(other, one, rtol=1e-3, atol=1e-4)
        for one, other in zip(seen.second(small), seen.second(wide), strict=True):
            for name in ("rel_depth", "ego", "mixture", "residual", "seen"):
                torch.testing.assert_close(getattr(other, name), getattr(one, name), rtol=1e-3, atol=1e-4)


def test_further_channels_can_learn(small, look):
    """Those of the further channels see something (a rectifier may shut one), and those that do not listen could."""
    seen = look((small.config.stride, small.config.stride))
    with torch.random.fork_rng():
        torch.manual_seed(1)
        wide = widened(small, PRESETS["base"])
    answer = seen.second(wide)[-1]
    (answer.mixture[:, 0].square().mean() + answer.seen.square().mean()).backward()
    network = wide.second_pass.network
    for listener in (network.decoder[-1].merge, network.heads[-1]):
        assert (listener.weight.grad.abs().amax((0, 2, 3)) > 0).float().mean() > 0.9


@pytest.mark.parametrize("change", [{"hidden": 8}, {"growth": 10}, {"depth_growth": 2}, {"layers": 3}, {"objects": 2}])
def test_a_shape_that_is_not_wider_is_refused(small, change):
    with pytest.raises(BadInput, match="wide"):
        widened(small, replace(PRESETS["base"], **change))


@pytest.mark.parametrize(("start", "shape"), [("ecn", "base"), ("small", "ecn")])
def test_the_rival_neither_grows_nor_is_grown_into(start, shape):
    with pytest.raises(BadInput, match="ecn"):
        widened(network_of(PRESETS[start]), PRESETS[shape])
