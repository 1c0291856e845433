"""Join scales by their pixels and named terms by their weights."""

from collections.abc import Mapping, Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from evimo.errors import BadInput


def weighted_total(per_scale: Sequence[Float[Tensor, "..."]]) -> Float[Tensor, ""]:
    """Mean over all pixels of all scales: each scale counts by the number of its pixels (paper, loss functions)."""
    pixels = sum(scale.numel() for scale in per_scale)
    return torch.stack([scale.sum() for scale in per_scale]).sum() / max(pixels, 1)


def total(terms: Mapping[str, Float[Tensor, ""]], weights: Mapping[str, float]) -> Float[Tensor, ""]:
    """Sum of the named terms times their weights; a term of weight 0 takes no part, not even if it is nan.

    Raises:
        BadInput: a name has a weight but no term, or a term but no weight.
    """
    if odd := sorted(terms.keys() ^ weights.keys()):
        raise BadInput(
            f"loss terms and weights differ: {', '.join(odd)}", fix="give each term a weight, 0 to ignore it"
        )
    return torch.stack([weight * terms[name] for name, weight in weights.items() if weight]).sum()
