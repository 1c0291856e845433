import pytest
import torch

from evimo.model.depth_net import DepthNet
from evimo.model.presets import PRESETS


@pytest.fixture
def inputs(rng):
    """Voxels, fits, valid and grid of an image of 32x48."""
    images = torch.rand(1, 30, 32, 48, generator=rng), torch.rand(1, 24, 16, 24, generator=rng)
    return *images, torch.ones(1, 1, 16, 24), torch.rand(1, 2, 16, 24, generator=rng)


@pytest.fixture
def net(rng):
    with torch.random.fork_rng():
        torch.manual_seed(0)
        return DepthNet(PRESETS["tiny"]).eval()


def test_other_slices_are_not_looked_at(net, inputs):
    voxels, fits, *rest = (each.clone() for each in inputs)
    before = net(voxels, fits, *rest)
    voxels[:, :12] = voxels[:, 18:] = 9
    fits[:, 12:] = -9  # of the whole stack
    torch.testing.assert_close(net(voxels, fits, *rest), before, atol=0, rtol=0)


@pytest.mark.parametrize(("which", "channel"), [(0, 12), (0, 17), (1, 0), (1, 11), (2, 0), (3, 0), (3, 1)])
def test_all_that_is_known_of_the_middle_slice_is_looked_at(net, inputs, which, channel):
    before = net(*inputs)[-1]
    changed = [each.clone() for each in inputs]
    changed[which][:, channel] += torch.linspace(-3, 3, changed[which].shape[-1])
    assert (net(*changed)[-1] - before).abs().max() > 1e-4


def test_depth_stays_within_a_factor_of_20(net, inputs):
    with torch.no_grad():
        for head in net.network.heads:
            head.weight *= 1e4
        scales = net(*inputs)
    assert all(scale.abs().max() <= 3 for scale in scales)
    assert scales[-1].abs().max() > 2.9
