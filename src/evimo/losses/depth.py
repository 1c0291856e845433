"""Depth: bring prediction and truth to one scale, then compare."""

import torch
from jaxtyping import Bool, Float
from torch import Tensor


def mean_over(values: Float[Tensor, "B C H W"], valid: Bool[Tensor, "B 1 H W"]) -> Float[Tensor, "B 1 1 1"]:
    """Mean of each sample over its valid pixels, 1 where a sample has none.

    Depths divided by it are relative (mean 1); the same number divides the translations that go with the depth.
    """
    chosen = valid.expand_as(values)
    count = chosen.sum(dim=(1, 2, 3), keepdim=True)
    total = torch.where(chosen, values, 0).sum(dim=(1, 2, 3), keepdim=True)
    return torch.where(count > 0, total / count.clamp(min=1), 1)


def depth_loss(
    predicted: Float[Tensor, "B 1 H W"], truth: Float[Tensor, "B 1 H W"], valid: Bool[Tensor, "B 1 H W"]
) -> Float[Tensor, "B 1 H W"]:
    """Ratio plus relative error: 1 where perfect, 0 where not `valid` (paper, depth loss).

    Depths are both in metres or both relative.
    """
    truth = torch.where(valid, truth, 1)  # before dividing: masking afterwards leaves 0 * inf = nan in the gradient
    ratio = torch.maximum(truth / predicted, predicted / truth)
    return torch.where(valid, ratio + (predicted - truth).abs() / truth, 0)
