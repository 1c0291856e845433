"""Smoothness: first differences of the mixture, second differences of the depth."""

from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import pad


def mixture_smoothness(mixture: Float[Tensor, "B C H W"]) -> Float[Tensor, "B 1 H W"]:
    """Sum of |first differences| of all mixture weights to the right and downwards (paper, mask smoothness).

    0 for the step beyond the last column or row. A straight edge of a mask costs 2 per pixel of its length:
    what one channel loses another one gains.
    """
    across = pad(mixture.diff(dim=-1).abs(), (0, 1))
    along = pad(mixture.diff(dim=-2).abs(), (0, 0, 0, 1))
    return (across + along).sum(dim=1, keepdim=True)


def depth_smoothness(predicted: Float[Tensor, "B 1 H W"]) -> Float[Tensor, "B 1 H W"]:
    """|Second differences| of the depth along x plus along y (paper, depth smoothness); 0 on the border.

    Planes whose depth is linear in the image are free. In the unit of the depth: divide it by its mean first.
    """
    height, width = predicted.shape[-2:]
    across, along = predicted.diff(n=2, dim=-1).abs(), predicted.diff(n=2, dim=-2).abs()
    across = pad(across, (1, width - 1 - across.shape[-1]))
    along = pad(along, (0, 0, 1, height - 1 - along.shape[-2]))
    return across + along
