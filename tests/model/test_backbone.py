import pytest
import torch

from evimo.model.backbone import Convolution, EvenlyCascaded, enlarged, reduced, shares, summed
from evimo.model.motion_net import MotionNet
from evimo.model.presets import PRESETS


@pytest.mark.parametrize(("channels", "size"), [(3, 3), (40, 1)])
def test_weights_are_standardised(channels, size, rng):
    layer = Convolution(channels, 5, size=size)
    with torch.no_grad():
        layer.weight.copy_(3 + 2 * torch.randn(layer.weight.shape, generator=rng))
        layer.gain.copy_(torch.arange(1.0, 6).view(5, 1, 1, 1))
        used = layer.standardised()
    torch.testing.assert_close(used.mean((1, 2, 3)), torch.zeros(5), atol=1e-5, rtol=0)
    torch.testing.assert_close(used.flatten(1).norm(dim=1), torch.arange(1.0, 6), atol=0, rtol=1e-4)


def test_a_constant_image_is_not_seen_away_from_the_border():
    layer = Convolution(2, 4)
    with torch.no_grad():
        found = layer(torch.full((1, 2, 6, 6), 7.0))[..., 1:-1, 1:-1]
    torch.testing.assert_close(found, layer.bias.detach().view(1, 4, 1, 1).expand_as(found), atol=1e-4, rtol=0)


def test_reducing_counts_every_pixel():
    image = torch.zeros(1, 1, 6, 6)
    image[0, 0, 0, 5] = 9
    assert reduced(image, 3)[0, 0].tolist() == [[0, 1], [0, 0]]


@pytest.mark.parametrize("scale", [2, 3])
def test_enlarging_keeps_pixel_areas_aligned(scale):
    slope = torch.arange(5.0).view(1, 1, 1, 5).repeat(1, 1, 4, 1)
    large = enlarged(slope, scale)
    assert large.shape == (1, 1, 4 * scale, 5 * scale)
    inner = large[0, 0, 0, scale:-scale]  # linear where no border is near: pixel X lies at (X + 1/2) / scale - 1/2
    expected = (torch.arange(5.0 * scale) + 0.5) / scale - 0.5
    torch.testing.assert_close(inner, expected[scale:-scale])


def test_shares_are_a_softmax_that_bears_any_logits(rng):
    logits = torch.randn(2, 4, 3, 3, generator=rng)
    torch.testing.assert_close(shares(logits), logits.softmax(1))
    torch.testing.assert_close(summed(logits), logits.sum(1, keepdim=True))
    extreme = shares(torch.tensor([1e4, -1e4, 0.0]).view(1, 3, 1, 1))
    torch.testing.assert_close(extreme.flatten(), torch.tensor([1.0, 0, 0]), atol=1e-6, rtol=0)


@pytest.mark.parametrize("preset", ["base", "small", "tiny"])
@pytest.mark.parametrize("part", ["second_pass.network", "first_pass.flow_net", "first_pass.depth_net.network"])
def test_predictions_run_from_coarse_to_half_the_inputs_size(preset, part, rng):
    network = MotionNet(PRESETS[preset]).get_submodule(part)
    layers = len(network.encoder)
    side = 2 * 2**layers
    inputs = (network.stem.in_channels, side, 2 * side), (network.beside.in_channels, side // 2, side)
    found = network(*(torch.randn(2, *shape, generator=rng) for shape in inputs))
    out = network.heads[0].out_channels
    assert [tuple(each.shape) for each in found] == [(2, out, 2**k, 2 * 2**k) for k in range(layers + 1)]


def test_a_finer_prediction_adds_to_the_coarser_one(rng):
    network = EvenlyCascaded(3, 2, 4, hidden=4, growth=3, layers=2)
    image, beside = torch.randn(1, 3, 16, 24, generator=rng), torch.randn(1, 2, 8, 12, generator=rng)
    with torch.no_grad():
        before = network(image, beside)
        network.heads[2].weight.zero_()  # nothing to add at the finest scale
        after = network(image, beside)
    torch.testing.assert_close(after[:2], before[:2])
    torch.testing.assert_close(after[2], enlarged(before[1], 2))
    assert not torch.allclose(before[2], after[2], atol=1e-4)


@pytest.mark.parametrize("which", ["image", "beside"])
def test_both_inputs_are_seen(which, rng):
    network = EvenlyCascaded(3, 2, 4, hidden=4, growth=3, layers=2)
    image, beside = torch.randn(1, 3, 16, 24, generator=rng), torch.randn(1, 2, 8, 12, generator=rng)
    before = network(image, beside)[-1]
    after = network(image + (which == "image") * torch.randn(image.shape, generator=rng), beside * (which == "image"))
    assert (before - after[-1]).abs().mean() > 1e-3


def test_lower_precision_gives_nearly_the_same_in_float32(rng):
    network = EvenlyCascaded(3, 2, 4, hidden=4, growth=3, layers=2)
    inputs = torch.randn(1, 3, 16, 24, generator=rng), torch.randn(1, 2, 8, 12, generator=rng)
    with torch.no_grad():
        exact = network(*inputs)[-1]
        network.precision = torch.bfloat16
        rough = network(*inputs)[-1]
    assert rough.dtype == torch.float32
    assert 0 < (rough - exact).abs().max() < 0.05 * exact.abs().max()
