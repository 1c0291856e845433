"""Twist and inverse depth to image velocity: the paper's eq. 1 and eq. 2, torch, differentiable and exportable."""

import torch
from jaxtyping import Float
from torch import Tensor


def motion_field(
    twist: Float[Tensor, "*#batch 6 #H #W"],
    inv_depth: Float[Tensor, "*#batch 1 #H #W"],
    grid: Float[Tensor, "*#batch 2 #H #W"],
) -> Float[Tensor, "*batch 2 H W"]:
    """Image velocity of points seen by a moving camera (paper, eq. 1). Its compiled twin is `static_flow` of streaming.

    Args:
        twist: motion of the camera relative to the points, camera axes, m/s and rad/s.
        inv_depth: 1/Z in 1/m. With relative depth, translations are in mean depths per second.
        grid: (x, y) on the plane Z = 1.

    Returns:
        d(x, y)/dt on that plane, in 1/s; times (fx, fy) it is px/s.
    """
    vx, vy, vz, wx, wy, wz = twist.unbind(-3)
    x, y = grid.unbind(-3)
    inv_z = inv_depth.squeeze(-3)
    u = inv_z * (x * vz - vx) + x * y * wx - (1 + x * x) * wy + y * wz
    v = inv_z * (y * vz - vy) + (1 + y * y) * wx - x * y * wy - x * wz
    return torch.stack((u, v), dim=-3)


def pixel_residual(
    residual: Float[Tensor, "*batch C 3"], mixture: Float[Tensor, "*batch C+1 H W"]
) -> Float[Tensor, "*batch 3 H W"]:
    """Residual translation of each pixel, sum of m_j t_j over the objects, m/s (the sum of paper eq. 2).

    Its negative is the velocity, in camera axes, of what the pixel shows.
    """
    return torch.einsum("...cd,...chw->...dhw", residual, mixture[..., 1:, :, :])


def pixel_twist(
    ego: Float[Tensor, "*batch 6"],
    residual: Float[Tensor, "*batch C 3"],
    mixture: Float[Tensor, "*batch C+1 H W"],
) -> Float[Tensor, "*batch 6 H W"]:
    """Twist of the camera relative to what each pixel shows (paper, eq. 2).

    Args:
        ego: the camera's twist relative to the static world, m/s and rad/s.
        residual: translations t_j added to it, m/s; an object that moves with velocity w has t_j = -w.
        mixture: weights that sum to 1 over the channels; channel 0 is the background.
    """
    translation = pixel_residual(residual, mixture)
    return ego[..., None, None] + torch.cat((translation, translation * 0), dim=-3)
