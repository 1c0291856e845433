"""Motion candidates from log counts of event frames: what the pose network chooses from.

One window and one baseline cannot serve all speeds (docs/reproduce.md has the measurements): slow motion shows over
several slices, fast motion only after the slices have been warped by a first guess.
"""

from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor

from evimo.geometry.grids import pixel_grid
from evimo.geometry.warping import sample
from evimo.model.backbone import enlarged, reduced
from evimo.model.lucas_kanade import (
    Products,
    directional_trust,
    local_motion,
    products,
    smoothed,
    trust,
)

CANDIDATES = 5
TRUSTS = 9
CHANNELS = 2 * CANDIDATES + TRUSTS + 3
FASTEST_PX = 6.0  # of half the image per slice: first guesses beyond it are noise


class Evidence(NamedTuple):
    """Local motion on a coarse grid of half the image.

    motion: (B, 5, 2, h, w) candidates, px of half the image per slice: small window; large window; long baseline, for
        slow motion; refined after warping by the large window's; refined after warping by a coarse image's, for fast
        motion.
    trust:  (B, 9, h, w) of the unwarped and both warped images, 0...1.
    across: (B, 3, h, w) trust by direction, (xx, xy, yy).
    """

    motion: Tensor
    trust: Tensor
    across: Tensor

    @classmethod
    def unpacked(cls, channels: Float[Tensor, "B 22 h w"]) -> "Evidence":
        """From all channels one after another, as the exported graph takes them."""
        motion, trusts, across = channels.split((2 * CANDIDATES, TRUSTS, 3), dim=1)
        return cls(motion.unflatten(1, (CANDIDATES, 2)), trusts, across)


def evidence(counts: Float[Tensor, "B N 2 H W"], reduction: int) -> Evidence:
    """Evidence on the grid `reduction` times coarser than the counts.

    Args:
        counts: log(1 + count) of positive and negative events, at half the image's size, N = 5 slices.
        reduction: divides H and W.
    """
    batch, slices = counts.shape[:2]
    images = smoothed(counts.flatten(0, 1), 0.7).unflatten(0, (batch, slices))
    first, before, here, after, last = images.unbind(1)
    near = products(before, here, after)
    baseline = near.plus(products(first, before, here)).plus(products(here, after, last))
    slow = _long(first, here, last)
    small, large = near.windowed(reduction, 0.7), near.windowed(reduction, 8.0 / reduction)
    at_large = local_motion(large)
    coarse = reduced((counts[:, 1:4].exp() - 1).flatten(1, 2), reduction).log1p().unflatten(1, (3, 2))
    coarse = smoothed(coarse.flatten(0, 1), 0.7).unflatten(0, (batch, 3))
    at_coarse = reduction * local_motion(products(*coarse.unbind(1)).windowed(1, 4.0))
    guesses = [_bounded(guess) for guess in (at_large, at_coarse)]
    warped = [_after_warp(before, here, after, guess, reduction) for guess in guesses]
    refined = [guess + _bounded(local_motion(found)) for guess, found in zip(guesses, warped, strict=True)]
    at_slow = local_motion(baseline.plus(slow).windowed(reduction, 5.0 / reduction))
    return Evidence(
        motion=torch.stack((local_motion(small), at_large, at_slow, *refined), dim=1),
        trust=torch.cat([trust(found) for found in (small, *warped)], dim=1),
        across=directional_trust(small),
    )


def _long(first: Tensor, here: Tensor, last: Tensor) -> Products:
    """Products over the whole stack: four slices from the first image to the last."""
    return products(first, here, last, slices=4.0)


def _bounded(motion: Tensor) -> Tensor:
    return motion.clamp(-FASTEST_PX, FASTEST_PX)


def _after_warp(before: Tensor, here: Tensor, after: Tensor, guess: Tensor, reduction: int) -> Products:
    """Products that remain after both neighbours were warped to the middle slice by a guess."""
    shift = enlarged(smoothed(guess, 0.7), reduction)
    at = pixel_grid(here)
    return products(sample(before, at - shift), here, sample(after, at + shift)).windowed(reduction, 4.0 / reduction)
