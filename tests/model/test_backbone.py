import pytest
import torch

from evimo.model.backbone import Encoder, decoding_layers, enlarged, normalised, reduced, shares


@pytest.mark.parametrize(("channels", "groups"), [(8, 8), (32, 16), (24, 12), (40, 10), (7, 7), (34, 2), (17, 1)])
def test_group_normalisation_has_the_largest_divisor_up_to_16(channels, groups):
    assert normalised(channels).num_groups == groups


def test_reducing_by_3_counts_every_pixel():
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
    extreme = shares(torch.tensor([1e4, -1e4, 0.0]).view(1, 3, 1, 1))
    torch.testing.assert_close(extreme.flatten(), torch.tensor([1.0, 0, 0]), atol=1e-6, rtol=0)


@pytest.mark.parametrize("scale", [2, 3])
def test_decoder_returns_to_the_size_of_the_encoders_input(scale, rng):
    shape = {"hidden": 8, "growth": 4, "layers": 2, "scale": scale}
    *skips, features = Encoder(3, **shape)(torch.randn(1, 3, scale**2 * 2, scale**2 * 3, generator=rng))
    assert features.shape == (1, 16, 2, 3)
    for layer, skip in zip(decoding_layers(**shape), reversed(skips), strict=True):
        features = layer(features, skip)
        assert features.shape == skip.shape
    assert features.shape[1] == 8


def test_what_lies_beside_is_added_after_the_stem(rng):
    encoder = Encoder(3, hidden=8, growth=4, layers=1, scale=2)
    image, beside = (torch.randn(1, channels, 4, 4, generator=rng) for channels in (3, 8))
    torch.testing.assert_close(encoder(image, beside)[0] - encoder(image)[0], beside)
