"""Egomotion and residual translations by weighted least squares: equation 1 is linear in the twist.

A pooled regression head did not learn egomotion (docs/reproduce.md); the flow of all pixels, their depth and the masks
determine it.
"""

from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Float
from torch import Tensor

from evimo.geometry.motion_field import motion_field

_NEXT, _LAST = (1, 2, 0), (2, 0, 1)  # rows and columns of a cofactor
_MINORS = [
    [3 * rows[i] + columns[j] for i in range(3) for j in range(3)]
    for rows, columns in ((_NEXT, _NEXT), (_LAST, _LAST), (_NEXT, _LAST), (_LAST, _NEXT))
]


def _picked(matrix: Tensor, minors: list[int]) -> Tensor:
    """Nine elements of a matrix (..., 9), by slices: an index would be copied to a GPU at each call."""
    return torch.stack([matrix[..., minor] for minor in minors], dim=-1)


def inverse(matrix: Float[Tensor, "*b 3 3"]) -> Float[Tensor, "*b 3 3"]:
    """Inverse of a symmetric 3x3 matrix: its cofactors over its determinant."""
    flat = matrix.flatten(-2)
    a, b, c, d = (_picked(flat, minors) for minors in _MINORS)
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


@dataclass(frozen=True)
class Geometry:
    """What fits must know of a scale's depth and lens.

    inv_depth: (B, 1, h, w) relative.
    grid:      (B, 2, h, w) on the plane Z = 1.
    focal_px:  (B, 2, 1, 1) px of the rectified image per unit of the plane.
    """

    inv_depth: Tensor
    grid: Tensor
    focal_px: Tensor

    @cached_property
    def basis(self) -> Tensor:
        """(B, 6, 2, h, w) flow on the plane Z = 1 for a unit of each component of the twist: A of equation 1."""
        x, y = self.grid.split(1, dim=1)
        inv_z, zero = self.inv_depth, x * 0  # zeros_like would freeze the size in an exported graph
        u = torch.cat((-inv_z, zero, inv_z * x, x * y, -(1 + x * x), y), dim=1)
        v = torch.cat((zero, -inv_z, inv_z * y, 1 + y * y, -x * y, -x), dim=1)
        return torch.stack((u, v), dim=2)

    def rigid_flow(self, ego: Float[Tensor, "B 6"]) -> Float[Tensor, "B 2 h w"]:
        """Flow of the static world, px (paper, eq. 1)."""
        return motion_field(ego[..., None, None], self.inv_depth, self.grid) * self.focal_px


@dataclass(frozen=True)
class Prior:
    """What is known of a twist before a fit.

    mean: (B, 6). precision: (B, 6), against an average weight of 1.
    """

    mean: Tensor
    precision: Tensor


def fitted(
    geometry: Geometry, flow: Float[Tensor, "B 2 h w"], weight: Float[Tensor, "B 1 h w"], prior: Prior
) -> Float[Tensor, "B 6"]:
    """The twist that explains the flow, px, best; no weight anywhere gives the prior's mean."""
    total = weight.sum((1, 2, 3))[:, None, None] + 1e-3
    basis = geometry.basis.flatten(2)  # B 6 2hw
    weighted = (geometry.basis * weight[:, None]).flatten(2) / total
    identity = torch.eye(6, device=flow.device, dtype=flow.dtype)
    matrix = weighted @ basis.transpose(-1, -2) + identity * prior.precision[..., None]
    right = weighted @ (flow / geometry.focal_px).flatten(1)[..., None] + (prior.precision * prior.mean)[..., None]
    return solved(matrix, right)[..., 0]


def robustly_fitted(
    geometry: Geometry,
    flow: Float[Tensor, "B 2 h w"],
    weight: Float[Tensor, "B 1 h w"],
    prior: Prior,
    *,
    guess: Tensor | None = None,
) -> Float[Tensor, "B 6"]:
    """The twist that explains most of the flow; what moves by itself loses its say (Cauchy's weights).

    Args:
        geometry: of the flow's grid.
        flow: px.
        weight: of each pixel.
        prior: of the twist.
        guess: a twist to start from; without one, plain least squares.
    """
    ego = fitted(geometry, flow, weight, prior) if guess is None else guess
    trusted = weight
    for _ in range(2 if guess is None else 1):
        square = (flow - geometry.rigid_flow(ego)).square().sum(1, keepdim=True)
        scatter = (square * trusted).sum((1, 2, 3), keepdim=True) / (trusted.sum((1, 2, 3), keepdim=True) + 1e-3)
        trusted = weight / (1 + square / (scatter + 0.01))
        ego = fitted(geometry, flow, trusted, prior)
    return ego


def residual_translations(
    geometry: Geometry,
    error: Float[Tensor, "B 2 h w"],
    mixture: Float[Tensor, "B channels h w"],
    *,
    weight: Tensor,
    prior: Tensor,
) -> Float[Tensor, "B C 3"]:
    """Translation t_j of each mixture channel that explains, times its share m_j, the flow that is left (paper, eq. 2).

    Args:
        geometry: of the flow's grid.
        error: flow that the egomotion does not explain, px.
        mixture: shares of the background and of C objects.
        weight: (B, 1, h, w) of each pixel.
        prior: precision of a translation about 0, against an average weight of 1.
    """
    basis = geometry.basis[:, :3].flatten(2)[:, None]  # B 1 3 2hw
    share = mixture[:, 1:]
    total = (share.square() * weight).sum((2, 3))[..., None, None] + 1.0
    squares = (share.square() * weight)[:, :, None].expand(-1, -1, 2, -1, -1).flatten(2)[:, :, None]
    first = (share * weight)[:, :, None].expand(-1, -1, 2, -1, -1).flatten(2)[:, :, None]
    matrix = (squares * basis) @ basis.transpose(-1, -2) / total
    right = (first * basis) @ (error / geometry.focal_px).flatten(1)[:, None, :, None] / total
    identity = torch.eye(3, device=error.device, dtype=error.dtype)
    return solved(matrix + prior * identity, right)[..., 0]
