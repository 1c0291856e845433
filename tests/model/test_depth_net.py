import pytest
import torch

from evimo.model.depth_net import DepthNet
from evimo.model.presets import PRESETS, ModelConfig


@pytest.mark.parametrize("name", PRESETS)
def test_scales_run_from_coarse_to_fine(name, rng):
    config = PRESETS[name]
    side = config.scale**config.layers
    scales = DepthNet(config, 4)(torch.randn(1, 4, side, 2 * side, generator=rng))
    sizes = [config.scale ** (k + 1) for k in range(config.layers)]
    assert [tuple(scale.shape) for scale in scales] == [(1, 1, size, 2 * size) for size in sizes]


def test_depth_stays_within_a_factor_of_20(rng):
    net = DepthNet(ModelConfig(hidden=8, growth=8, layers=2, scale=2), 2)
    with torch.no_grad():
        for head in net.heads:
            head[-1].weight *= 1000
        scales = net(torch.randn(1, 2, 8, 8, generator=rng))
    assert all(scale.abs().max() <= 3 for scale in scales)
    assert scales[-1].abs().max() > 2.9


def test_each_scale_refines_the_coarser_one(rng):
    net = DepthNet(ModelConfig(hidden=8, growth=8, layers=2, scale=2), 2)
    with torch.no_grad():
        net.heads[1][-1].weight.zero_()  # nothing to add at the finer scale
        coarse, fine = net(torch.randn(1, 2, 8, 8, generator=rng))
    torch.testing.assert_close(fine[..., 1::2, 1::2].mean(), coarse.mean(), atol=0.1, rtol=0)
    assert fine.abs().max() <= coarse.abs().max() + 1e-6
