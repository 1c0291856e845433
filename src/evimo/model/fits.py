"""Egomotion and residual translations by weighted least squares: equation 1 is linear in the twist.

A pooled regression head did not learn egomotion (docs/reproduce.md); the flow of all pixels, their depth and the masks
determine it.
"""

import torch
from jaxtyping import Float
from torch import Tensor


def solved(matrix: Float[Tensor, "*b N N"], right: Float[Tensor, "*b N"]) -> Float[Tensor, "*b N"]:
    """Solution of a symmetric positive definite system by Gauss-Jordan; ONNX has no solver. No pivots are needed."""
    rows = torch.cat((matrix, right[..., None]), dim=-1)
    size = matrix.shape[-1]
    off = 1 - torch.eye(size, device=matrix.device, dtype=matrix.dtype)[..., None]  # all rows but the pivot's
    for k in range(size):
        pivot = rows[..., k : k + 1, :] / rows[..., k : k + 1, k : k + 1]
        rows = torch.cat((rows[..., :k, :], pivot, rows[..., k + 1 :, :]), dim=-2) - off[k] * (
            rows[..., :, k : k + 1] * pivot
        )
    return rows[..., -1]


def flow_per_twist(inv_depth: Float[Tensor, "B 1 H W"], grid: Float[Tensor, "B 2 H W"]) -> Float[Tensor, "B 6 2 H W"]:
    """The matrix A of equation 1: flow of each pixel for a unit of each component of the twist."""
    x, y = grid.unbind(1)
    inv_z = inv_depth[:, 0]
    zero = x * 0  # zeros_like would freeze the size in an exported graph
    u = torch.stack((-inv_z, zero, inv_z * x, x * y, -(1 + x * x), y), dim=1)
    v = torch.stack((zero, -inv_z, inv_z * y, 1 + y * y, -x * y, -x), dim=1)
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
    total = (weight[:, :, 0] + weight[:, :, 2]).sum((-2, -1)) + 1e-3  # B C
    xx, xy, yy = (weight / total[:, :, None, None, None]).flatten(3).unbind(2)  # B C HW
    u, v = basis.flatten(3).unbind(2)  # B N HW
    weighted_u = xx[:, :, None] * u[:, None] + xy[:, :, None] * v[:, None]  # B C N HW
    weighted_v = xy[:, :, None] * u[:, None] + yy[:, :, None] * v[:, None]
    matrix = weighted_u @ u[:, None].transpose(-1, -2) + weighted_v @ v[:, None].transpose(-1, -2)
    flow_u, flow_v = flow.flatten(2).unbind(1)
    right = (weighted_u @ flow_u[:, None, :, None] + weighted_v @ flow_v[:, None, :, None])[..., 0]
    identity = torch.eye(basis.shape[1], device=flow.device, dtype=flow.dtype)
    return solved(matrix + prior * identity, right)


def mismatch(error: Float[Tensor, "B 2 H W"], weight: Float[Tensor, "B 3 H W"]) -> Float[Tensor, "B 1 H W"]:
    """e' W e of each pixel."""
    (x, y), (xx, xy, yy) = error.unbind(1), weight.unbind(1)
    return (xx * x * x + 2 * xy * x * y + yy * y * y)[:, None]
