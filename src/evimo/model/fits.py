"""Egomotion and residual translations by weighted least squares: equation 1 is linear in the twist.

A pooled regression head did not learn egomotion (docs/reproduce.md); the flow of all pixels, their depth and the masks
determine it.
"""

import torch
from jaxtyping import Float
from torch import Tensor

_NEXT, _LAST = (1, 2, 0), (2, 0, 1)  # rows and columns of a cofactor
_MINORS = [
    3 * rows[i] + columns[j]
    for rows, columns in ((_NEXT, _NEXT), (_LAST, _LAST), (_NEXT, _LAST), (_LAST, _NEXT))
    for i in range(3)
    for j in range(3)
]


def inverse(matrix: Float[Tensor, "*b 3 3"]) -> Float[Tensor, "*b 3 3"]:
    """Inverse of a symmetric 3x3 matrix: its cofactors over its determinant."""
    minors = matrix.flatten(-2).index_select(-1, torch.tensor(_MINORS, device=matrix.device))
    a, b, c, d = minors.split(9, dim=-1)
    cofactors = (a * b - c * d).unflatten(-1, (3, 3))
    return cofactors / ((matrix * cofactors).sum((-2, -1), keepdim=True) / 3)


def solved(matrix: Float[Tensor, "*b N N"], right: Float[Tensor, "*b N 1"]) -> Float[Tensor, "*b N 1"]:
    """Solution of a symmetric positive definite system of 3 or 6 unknowns, by blocks of 3: ONNX has no solver.

    Translation is eliminated first, then rotation solved for; few operators, where Gauss and Jordan's need a hundred.
    """
    if matrix.shape[-1] == 3:
        return inverse(matrix) @ right
    (a, b), (_, d) = (rows.split(3, dim=-1) for rows in matrix.split(3, dim=-2))
    first, second = right.split(3, dim=-2)
    from_a = inverse(a)
    share = b.transpose(-1, -2) @ from_a
    rotation = inverse(d - share @ b) @ (second - share @ first)
    return torch.cat((from_a @ (first - b @ rotation), rotation), dim=-2)


def flow_per_twist(inv_depth: Float[Tensor, "B 1 H W"], grid: Float[Tensor, "B 2 H W"]) -> Float[Tensor, "B 6 2 H W"]:
    """The matrix A of equation 1: flow of each pixel for a unit of each component of the twist."""
    x, y = grid.split(1, dim=1)
    zero = x * 0  # zeros_like would freeze the size in an exported graph
    u = torch.cat((-inv_depth, zero, inv_depth * x, x * y, -(1 + x * x), y), dim=1)
    v = torch.cat((zero, -inv_depth, inv_depth * y, 1 + y * y, -x * y, -x), dim=1)
    return torch.stack((u, v), dim=2)


def fitted(
    basis: Float[Tensor, "B N 2 H W"],
    flow: Float[Tensor, "B 2 H W"],
    weight: Float[Tensor, "B C 3 H W"],
    prior: Float[Tensor, " N"],
) -> Float[Tensor, "B C N"]:
    """Coefficients that best explain the flow, once per channel of weights.

    Args:
        basis: flow of each pixel for a unit of each coefficient.
        flow: to be explained, in the unit of the basis.
        weight: of each pixel's error e, as the symmetric matrix (xx, xy, yy) of e' W e: an edge tells only of the
            motion across it.
        prior: pulls each coefficient towards 0, against an average weight of 1; no weight anywhere gives 0.
    """
    xx, xy, yy = weight.flatten(3)[:, :, :, None].unbind(2)  # B C 1 HW
    total = (xx + yy).sum(-1, keepdim=True) + 1e-3
    known = torch.cat((basis, flow[:, None]), dim=1).flatten(2)[:, None]  # B 1 N+1 2HW: all of u, then all of v
    u, v = basis.flatten(3)[:, None].unbind(3)  # B 1 N HW
    weighted = torch.cat((xx * u + xy * v, xy * u + yy * v), dim=-1)  # B C N 2HW
    sums = weighted @ known.transpose(-1, -2) / total
    matrix, right = sums.split((basis.shape[1], 1), dim=-1)
    identity = torch.eye(basis.shape[1], device=flow.device, dtype=flow.dtype)
    return solved(matrix + prior * identity, right)[..., 0]


def mismatch(error: Float[Tensor, "B 2 H W"], weight: Float[Tensor, "B 3 H W"]) -> Float[Tensor, "B 1 H W"]:
    """e' W e of each pixel."""
    (x, y), (xx, xy, yy) = error.split(1, dim=1), weight.split(1, dim=1)
    return x * (xx * x + 2 * xy * y) + yy * y * y
