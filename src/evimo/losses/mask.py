"""The motion mask, supervised through m_0, the mixture weight of the background."""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

_TINY = 1e-6


def _surprise(probability: Tensor) -> Tensor:
    """-log of a probability, 0 at 1, but about 14 at 0: a saturated softmax must keep a finite gradient."""
    return -((probability + _TINY) / (1 + _TINY)).log()


def one_sided_mask_loss(
    background: Float[Tensor, "B 1 H W"], moving: Bool[Tensor, "B 1 H W"], valid: Bool[Tensor, "B 1 H W"]
) -> Float[Tensor, "B 1 H W"]:
    """-log m_0 on the background and nothing on the objects, as the paper states it.

    "All background" is then a perfect answer, so it is not used alone (docs/reproduce.md): see `mask_loss`.
    """
    right = torch.where(valid & ~moving, background, 1)
    return _surprise(right)


def mask_loss(
    background: Float[Tensor, "B 1 H W"], moving: Bool[Tensor, "B 1 H W"], valid: Bool[Tensor, "B 1 H W"]
) -> Float[Tensor, "B 1 H W"]:
    """Two-sided binary cross entropy: -log m_0 on the background, -log(1 - m_0) on moving objects, 0 if not valid.

    Times `balance(...)` it gives small objects their say.
    """
    right = torch.where(valid, torch.where(moving, 1 - background, background), 1)
    return _surprise(right)


def balance(
    moving: Bool[Tensor, "B 1 H W"],
    valid: Bool[Tensor, "B 1 H W"],
    *,
    moving_share: float,
    limit: float = 20.0,
) -> Float[Tensor, "B 1 H W"]:
    """Weights with mean 1 over each sample's valid pixels, in which moving pixels hold `moving_share` of the sum.

    Args:
        moving: truth.
        valid: where the truth is known; weights are 0 elsewhere.
        moving_share: 0...1, for every sample that has both movers and background; any other keeps weights of 1.
        limit: largest weight of a moving pixel; it keeps an object of a few pixels from being all that counts.
    """
    moving, still = moving & valid, ~moving & valid
    count = valid.sum(dim=(1, 2, 3), keepdim=True).float()
    movers = moving.sum(dim=(1, 2, 3), keepdim=True).float()
    for_moving = (moving_share * count / movers.clamp(min=1)).clamp(max=limit)
    for_moving = torch.where(movers < count, for_moving, 1)
    for_still = (count - for_moving * movers) / (count - movers).clamp(min=1)
    return for_moving * moving + for_still * still


def dice_loss(
    background: Float[Tensor, "B 1 H W"],
    moving: Bool[Tensor, "B 1 H W"],
    valid: Bool[Tensor, "B 1 H W"],
    *,
    slack_px: float = 1.0,
) -> Float[Tensor, " B"]:
    """1 - soft Dice overlap of 1 - m_0 with the moving pixels, per sample; blind to the size of the object.

    `slack_px` is added to both sides of the fraction: a sample without movers costs 0 if nothing is called moving.
    """
    called = torch.where(valid, 1 - background, 0).sum(dim=(1, 2, 3))
    true = (moving & valid).sum(dim=(1, 2, 3))
    both = torch.where(moving & valid, 1 - background, 0).sum(dim=(1, 2, 3))
    return 1 - (2 * both + slack_px) / (called + true + slack_px)
