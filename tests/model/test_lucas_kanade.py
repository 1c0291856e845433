from math import pi

import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter

from evimo.model.lucas_kanade import (
    differences,
    directional_trust,
    gaussian,
    local_motion,
    products,
    smoothed,
    trust,
)


@pytest.fixture
def waves():
    """Images (1, 2, 96, 120) of a random pattern, exactly moved by (dx, dy) px per slice at slice n."""
    rng = np.random.default_rng(0)
    phase = rng.uniform(0, 2 * pi, (2, 30, 1, 1))
    angle = (np.arange(30) * pi / 30).reshape(30, 1, 1)  # evenly spread: as much contrast in y as in x
    per_px = 2 * pi / rng.uniform(8, 20, (2, 30, 1, 1))
    y, x = np.mgrid[:96, :120]

    def image(n, dx, dy):
        along = np.cos(angle) * (x - n * dx) + np.sin(angle) * (y - n * dy)
        return torch.tensor(np.cos(per_px * along + phase).sum(1) / 10)[None].float()

    return image


def test_blur_is_that_of_scipy(rng):
    image = torch.randn(1, 2, 9, 11, generator=rng)
    expected = [gaussian_filter(plane.numpy(), 1.3, mode="constant", truncate=2.5) for plane in image[0]]
    torch.testing.assert_close(smoothed(image, 1.3)[0], torch.tensor(np.stack(expected)), atol=1e-6, rtol=1e-5)
    assert sum(gaussian(0.7)) == pytest.approx(1)


def test_differences_are_per_px():
    y, x = torch.meshgrid(torch.arange(6.0), torch.arange(7.0), indexing="ij")
    in_x, in_y = differences((3 * x - 2 * y)[None, None])
    assert in_x[0, 0, :, 1:-1].unique().tolist() == [3]
    assert in_y[0, 0, 1:-1, :].unique().tolist() == [-2]


@pytest.mark.parametrize("shift", [(0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.3, -0.6), (0.0, 0.0)])
def test_a_moved_pattern_shows_its_displacement(waves, shift):
    found = products(*(waves(n, *shift) for n in (-1, 0, 1))).windowed(4, 2.0)
    inner = local_motion(found)[0, :, 6:-6, 6:-6].flatten(1).mean(1)
    # The ridge shrinks every displacement: by 0.07 / (0.5 + 0.07) where contrast is spread evenly, else by more.
    torch.testing.assert_close(inner, torch.tensor(shift), atol=0.04, rtol=0.4)


def test_the_long_baseline_counts_its_slices(waves):
    found = products(*(waves(n, 0.25, 0.1) for n in (-2, 0, 2)), slices=4.0).windowed(4, 2.0)
    inner = local_motion(found)[0, :, 6:-6, 6:-6].flatten(1).mean(1)
    torch.testing.assert_close(inner, torch.tensor([0.25, 0.1]), atol=0.045, rtol=0.2)


def test_nothing_to_see_is_no_motion():
    empty = torch.zeros(1, 2, 12, 12)
    found = products(empty, empty, empty).windowed(3, 1.0)
    assert local_motion(found).abs().max() == 0
    assert directional_trust(found).abs().max() == 0
    assert trust(found).abs().max() == 0


def test_an_edge_is_trusted_across_only():
    y, x = torch.meshgrid(torch.arange(24.0), torch.arange(24.0), indexing="ij")
    for stripes, strong, weak in ((x, 0, 2), (y, 2, 0)):
        image = torch.sin(2 * pi / 8 * stripes)[None, None].repeat(1, 2, 1, 1)
        inner = directional_trust(products(image, image, image).windowed(2, 1.0))[0, :, 3:-3, 3:-3]
        assert inner[strong].min() > 0.5
        assert inner[weak].abs().max() < 0.02
        assert inner[1].abs().max() < 0.02


def test_trust_is_between_0_and_1(waves, rng):
    images = [waves(n, 0.5, 0.2) * (torch.rand(1, 2, 96, 120, generator=rng) > 0.5) for n in (-1, 0, 1)]
    found = products(*images).windowed(3, 1.0)
    values, across = trust(found), directional_trust(found)
    assert values.min() >= 0 and values.max() <= 1.001
    assert (across[:, 0] + across[:, 2]).max() < 1


def test_trust_tells_what_still_changes(waves):
    moving, still = (products(*(waves(n, dx, 0.0) for n in (-1, 0, 1))).windowed(4, 2.0) for dx in (1.0, 0.0))
    assert trust(moving)[0, 2, 3:-3, 3:-3].min() > 0.1
    assert trust(still)[0, 2].max() < 1e-6
