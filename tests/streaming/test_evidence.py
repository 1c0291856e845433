import numpy as np
import pytest
import torch

from evimo.model.evidence import evidence
from evimo.model.motion_net import at_half_size
from evimo.streaming.evidence import EVIDENCE, EvidenceMaker, halved_mask


def random_frames(size, *, rate=0.3, seed=0):
    """Event frames (5, 3, H, W)."""
    rng = np.random.default_rng(seed)
    counts = rng.poisson(rate, (5, 2, *size)).astype(np.float32)
    times = rng.random((5, 1, *size), np.float32) * (counts.sum(1, keepdims=True) > 0)
    return np.concatenate((counts, times), axis=1)


def by_torch(frames, maker):
    """Image and evidence as the model itself makes them."""
    size = [2 * side for side in maker.size]
    padded = np.zeros((1, 5, 3, *size), np.float32)
    padded[0, :, :, : frames.shape[2], : frames.shape[3]] = frames
    counts, times = at_half_size(torch.from_numpy(padded))
    found = evidence(counts, maker.reduction)
    channels = torch.cat((found.motion.flatten(1, 2), found.trust, found.across), dim=1)
    return torch.cat((counts.flatten(1, 2), times), dim=1)[0].numpy(), channels[0].numpy()


@pytest.mark.parametrize(("stride", "reduction"), [(18, 3), (32, 4)])
@pytest.mark.parametrize("gone", [[], [0, 4], [0, 1, 3, 4], [0, 1, 2, 3, 4]])
@pytest.mark.parametrize("size", [(54, 72), (47, 61)])
def test_compiled_and_torch_are_equal(size, gone, stride, reduction):
    frames = random_frames(size)
    frames[gone] = 0
    maker = EvidenceMaker(size, stride=stride, reduction=reduction)
    images = [maker.images(frame) for frame in frames]
    image, found = by_torch(frames, maker)
    np.testing.assert_allclose(maker.image(images), image, atol=1e-6, rtol=1e-6)
    np.testing.assert_allclose(maker.evidence(images), found, atol=2e-4, rtol=1e-3)
    assert maker.evidence(images).shape == (EVIDENCE, maker.size[0] // reduction, maker.size[1] // reduction)


def test_fast_motion_reads_beyond_the_image():
    frames = random_frames((54, 72), rate=0.1)
    for k in range(5):
        frames[k] = np.roll(frames[2], 9 * (k - 2), axis=2)
    maker = EvidenceMaker((54, 72), stride=18, reduction=3)
    images = [maker.images(frame) for frame in frames]
    np.testing.assert_allclose(maker.evidence(images), by_torch(frames, maker)[1], atol=1e-3, rtol=1e-3)


def test_an_empty_slice_is_nothing():
    maker = EvidenceMaker((47, 61), stride=18, reduction=3)
    for made, nothing in zip(maker.images(np.zeros((3, 47, 61), np.float32)), maker.nothing(), strict=True):
        np.testing.assert_array_equal(made, nothing)


def test_a_mask_at_half_size_holds_shares():
    mask = np.ones((5, 6), np.bool_)
    mask[:2, :2] = mask[0, 2] = False
    expected = [[0, 0.75, 1, 0], [1, 1, 1, 0], [0.5, 0.5, 0.5, 0], [0, 0, 0, 0]]
    assert halved_mask(mask, stride=8).tolist() == expected
