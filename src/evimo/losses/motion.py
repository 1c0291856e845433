"""Motion supervised by truth from the simulator: dense flow, egomotion, velocity of objects."""

import torch
from jaxtyping import Bool, Float
from torch import Tensor


def compressed(flow: Float[Tensor, "*shape"], *, knee: float) -> Float[Tensor, "*shape"]:
    """Flow u as u / (1 + |u| / knee), element by element: linear for slow, never beyond `knee` for fast motion."""
    return flow / (1 + flow.abs() / knee)


def flow_loss(
    predicted: Float[Tensor, "B 2 H W"],
    truth: Float[Tensor, "B 2 H W"],
    valid: Bool[Tensor, "B 1 H W"],
    *,
    knee: float = 3.0,
) -> Float[Tensor, "B 1 H W"]:
    """|difference of compressed flows|, summed over x and y; 0 where not `valid`.

    Uncompressed, a few fast scenes are all that counts. Both flows in the unit of `knee`; 3 is for px per slice.
    """
    truth = torch.where(valid, truth, 0)
    error = (compressed(predicted, knee=knee) - compressed(truth, knee=knee)).abs().sum(dim=1, keepdim=True)
    return torch.where(valid, error, 0)


def twist_loss(
    predicted: Float[Tensor, "*batch 6"],
    truth: Float[Tensor, "*batch 6"],
    *,
    mean_depth: Float[Tensor, "*#batch"],
) -> Float[Tensor, "*batch"]:
    """Length of the error in translation, in mean depths per second, plus in rotation, rad/s.

    Both are then image velocities at the mean depth, which is why they may be added.

    Args:
        predicted: relative egomotion: translation in mean depths per second.
        truth: m/s and rad/s.
        mean_depth: of the prediction's depths, m: what a relative depth of 1 means.
    """
    translation = predicted[..., :3] - truth[..., :3] / mean_depth[..., None]
    rotation = predicted[..., 3:] - truth[..., 3:]
    return translation.norm(dim=-1) + rotation.norm(dim=-1)


def object_velocity_loss(
    predicted: Float[Tensor, "B 3 H W"],
    truth: Float[Tensor, "B 3 H W"],
    moving: Bool[Tensor, "B 1 H W"],
) -> Float[Tensor, "B 1 H W"]:
    """Length of the velocity error inside moving objects, 0 outside.

    Args:
        predicted: velocity of what each pixel shows (minus `pixel_residual`), mean depths per second.
        truth: in the same unit, that is divided by the mean depth.
        moving: pixels of moving objects.
    """
    error = torch.where(moving, predicted - truth, 0)
    return error.norm(dim=1, keepdim=True)
