"""Rotations and rigid motions from their tangents and back: exp and log on SO(3) and SE(3), torch, differentiable.

Tangents are rotation vectors in rad, and twists (v, ω): translation first, m, then rotation, rad. `se3_exp(twist * dt)`
is where a body is after dt that starts at the identity and keeps its twist, given in its own axes.
"""

import torch
from jaxtyping import Float
from torch import Tensor

# Up to this angle the power series below are exact to the last bit of a float64, and the closed forms cancel.
_SMALL_RAD = 0.5
_SIN = (1.0, -1 / 6, 1 / 120, -1 / 5040, 1 / 362880, -1 / 39916800, 1 / 6227020800)  # sin θ / θ in powers of θ²
_COS = (1 / 2, -1 / 24, 1 / 720, -1 / 40320, 1 / 3628800, -1 / 479001600)  # (1 - cos θ) / θ²
_REST = (1 / 6, -1 / 120, 1 / 5040, -1 / 362880, 1 / 39916800, -1 / 6227020800)  # (θ - sin θ) / θ³
_INVERSE = (1 / 12, 1 / 720, 1 / 30240, 1 / 1209600, 1 / 47900160, 691 / 1307674368000, 1 / 74724249600)


def so3_exp(rotation: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3 3"]:
    """Rotation matrix of a rotation vector, rad (Rodrigues)."""
    angle2 = rotation.square().sum(-1)[..., None, None]
    cross = _cross_matrix(rotation)
    return _identity(3, like=rotation) + _sin_over(angle2) * cross + _cos_over(angle2) * (cross @ cross)


def so3_log(matrix: Float[Tensor, "*batch 3 3"]) -> Float[Tensor, "*batch 3"]:
    """Rotation vector of a rotation matrix, rad, of length 0...π; at π either of the two axes.

    By way of the quaternion, taken from its largest component, which is well-conditioned at every angle.
    """
    quaternion = _quaternion(matrix)
    real, imaginary = quaternion[..., :1], quaternion[..., 1:]
    sign = torch.where(real < 0, -1.0, 1.0).to(matrix)
    real, imaginary = sign * real, sign * imaginary
    sine2 = imaginary.square().sum(-1, keepdim=True)
    tiny = sine2 < 1e-12
    sine = torch.where(tiny, 1, sine2).sqrt()
    return imaginary * torch.where(tiny, 2 / real.clamp(min=0.5), 2 * torch.atan2(sine, real) / sine)


def se3_exp(twist: Float[Tensor, "*batch 6"]) -> Float[Tensor, "*batch 4 4"]:
    """Rigid motion of a twist (v, ω) kept for unit time, in m and rad."""
    rotation = twist[..., 3:]
    angle2 = rotation.square().sum(-1)[..., None, None]
    cross = _cross_matrix(rotation)
    left = _identity(3, like=twist) + _cos_over(angle2) * cross + _rest_over(angle2) * (cross @ cross)
    translation = left @ twist[..., :3, None]
    top = torch.cat((so3_exp(rotation), translation), dim=-1)
    bottom = twist.new_tensor((0, 0, 0, 1)).expand(*twist.shape[:-1], 1, 4)
    return torch.cat((top, bottom), dim=-2)


def se3_log(motion: Float[Tensor, "*batch 4 4"]) -> Float[Tensor, "*batch 6"]:
    """Twist (v, ω) that leads to a rigid motion in unit time; its rotation has length 0...π."""
    rotation = so3_log(motion[..., :3, :3])
    angle2 = rotation.square().sum(-1)[..., None, None]
    cross = _cross_matrix(rotation)
    inverse = _identity(3, like=motion) - cross / 2 + _inverse_over(angle2) * (cross @ cross)
    return torch.cat(((inverse @ motion[..., :3, 3:]).squeeze(-1), rotation), dim=-1)


def _cross_matrix(vector: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3 3"]:
    """The matrix that maps b to `vector` × b."""
    x, y, z = vector.unbind(-1)
    zero = torch.zeros_like(x)
    return torch.stack((zero, -z, y, z, zero, -x, -y, x, zero), dim=-1).unflatten(-1, (3, 3))


def _identity(size: int, *, like: Tensor) -> Float[Tensor, "n n"]:
    return torch.eye(size, device=like.device, dtype=like.dtype)


def _quaternion(matrix: Float[Tensor, "*batch 3 3"]) -> Float[Tensor, "*batch 4"]:
    """Unit quaternion (real part first) of a rotation, either sign."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = (row.unbind(-1) for row in matrix.unbind(-2))
    rows = (
        (1 + xx + yy + zz, zy - yz, xz - zx, yx - xy),
        (zy - yz, 1 + xx - yy - zz, xy + yx, xz + zx),
        (xz - zx, xy + yx, 1 - xx + yy - zz, yz + zy),
        (yx - xy, xz + zx, yz + zy, 1 - xx - yy + zz),
    )  # 4 q qᵀ: each row is the quaternion times four of its components
    outer = torch.stack([torch.stack(row, dim=-1) for row in rows], dim=-2)
    largest = outer.diagonal(dim1=-2, dim2=-1).argmax(-1)
    row = outer.gather(-2, largest[..., None, None].expand(*largest.shape, 1, 4)).squeeze(-2)
    return row / row.square().sum(-1, keepdim=True).sqrt()


def _series(angle2: Tensor, coefficients: tuple[float, ...]) -> Tensor:
    total = torch.zeros_like(angle2)
    for coefficient in reversed(coefficients):
        total = total * angle2 + coefficient
    return total


def _safe_angle(angle2: Tensor) -> tuple[Tensor, Tensor]:
    """Where the series holds, and the angle elsewhere (1 where it holds, so that no gradient divides by zero)."""
    small = angle2 < _SMALL_RAD**2
    return small, torch.where(small, 1, angle2).sqrt()


def _sin_over(angle2: Tensor) -> Tensor:
    small, angle = _safe_angle(angle2)
    return torch.where(small, _series(angle2, _SIN), angle.sin() / angle)


def _cos_over(angle2: Tensor) -> Tensor:
    small, angle = _safe_angle(angle2)
    return torch.where(small, _series(angle2, _COS), (1 - angle.cos()) / angle**2)


def _rest_over(angle2: Tensor) -> Tensor:
    small, angle = _safe_angle(angle2)
    return torch.where(small, _series(angle2, _REST), (angle - angle.sin()) / angle**3)


def _inverse_over(angle2: Tensor) -> Tensor:
    """(1 - θ/2 cot θ/2) / θ², the quadratic coefficient of the inverse of `left` in `se3_exp`."""
    small, angle = _safe_angle(angle2)
    half = angle / 2
    return torch.where(small, _series(angle2, _INVERSE), (1 - half * half.cos() / half.sin()) / angle**2)
