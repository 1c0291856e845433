"""Inverse warp and splat: `sample`, `splat`, and the image of warped events. Torch, differentiable.

Convention: coordinates are (x, y) in px, integers are pixel centres, `align_corners=True`. This is the only file that
calls `grid_sample`.
"""

from typing import NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor


class EventPoints(NamedTuple):
    """The events of a batch of slices as flat tensors, in any order; N may be 0.

    batch:    which sample of the batch, 0...B-1.
    x, y:     position in the (rectified) image, px; fractions are fine, positions must be inside the image.
    t:        s relative to the reference time of the flow, usually the slice centre, so about -0.0125...0.0125.
    positive: polarity; True is brighter.
    """

    batch: Int[Tensor, " N"]
    x: Float[Tensor, " N"]
    y: Float[Tensor, " N"]
    t: Float[Tensor, " N"]
    positive: Bool[Tensor, " N"]


def resized_points(events: EventPoints, size: tuple[int, int], new_size: tuple[int, int]) -> EventPoints:
    """The same events in the image resized from `size` to `new_size`, both (height, width), kept inside it."""
    (height, width), (new_height, new_width) = size, new_size
    x = ((events.x + 0.5) * (new_width / width) - 0.5).clamp(0, new_width - 1)
    y = ((events.y + 0.5) * (new_height / height) - 0.5).clamp(0, new_height - 1)
    return events._replace(x=x, y=y)


def inside(at: Float[Tensor, "*batch 2 H W"], size: tuple[int, int]) -> Bool[Tensor, "*batch 1 H W"]:
    """Whether positions (x, y) lie within the outermost pixel centres of an image of this (height, width)."""
    x, y = at[..., :1, :, :], at[..., 1:, :, :]
    return (x >= 0) & (x <= size[1] - 1) & (y >= 0) & (y <= size[0] - 1)


def sample(image: Float[Tensor, "B C H W"], at: Float[Tensor, "B 2 h w"]) -> Float[Tensor, "B C h w"]:
    """Read the image where each output pixel came from, bilinearly; outside the image is zero.

    Args:
        image: what to read.
        at: (x, y) in px of `image` for each output pixel.
    """
    height, width = image.shape[-2:]
    to_unit = at.new_tensor((2 / max(width - 1, 1), 2 / max(height - 1, 1)))
    unit = at.movedim(-3, -1) * to_unit - 1
    return torch.nn.functional.grid_sample(image, unit, mode="bilinear", padding_mode="zeros", align_corners=True)


def splat(
    xy: Float[Tensor, "N 2"],
    weight: Float[Tensor, " N"],
    size: tuple[int, int, int],
    *,
    plane: Int[Tensor, " N"],
) -> Float[Tensor, "P H W"]:
    """Add each weight to the four pixels around where it went; what falls outside the image is lost.

    Args:
        xy: positions in px.
        weight: what each point carries.
        size: planes, height, width of the result.
        plane: which plane of the result each point belongs to.
    """
    planes, height, width = size
    corner = xy.detach().floor()
    right, down = (xy - corner).unbind(-1)
    left_column, top_row = corner.long().unbind(-1)
    image = weight.new_zeros(planes * height * width)
    for dx, dy, share in (
        (0, 0, (1 - right) * (1 - down)),
        (1, 0, right * (1 - down)),
        (0, 1, (1 - right) * down),
        (1, 1, right * down),
    ):
        column, row = left_column + dx, top_row + dy
        within = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        pixel = (plane * height + row.clamp(0, height - 1)) * width + column.clamp(0, width - 1)
        image = image.index_add(0, pixel, share * weight * within)
    return image.view(planes, height, width)


def image_of_warped_events(flow: Float[Tensor, "B 2 H W"], events: EventPoints) -> Float[Tensor, "B 2 H W"]:
    """Counts of events, positive then negative, after each has moved along the flow to the reference time.

    An event that would leave the image stays where it was, so that every event is counted, always: leaving pays
    no better than claiming no motion.

    Args:
        flow: px/s at the reference time; each event follows the flow of its own pixel.
        events: of the same batch.
    """
    batch, _, height, width = flow.shape
    column = events.x.round().long().clamp(0, width - 1)
    row = events.y.round().long().clamp(0, height - 1)
    u = flow[events.batch, :, row, column]
    here = torch.stack((events.x, events.y), dim=-1)
    there = here - events.t[:, None] * u
    last = here.new_tensor((width - 1, height - 1))
    stays_in = ((there >= 0) & (there <= last)).all(-1, keepdim=True)
    plane = 2 * events.batch + (~events.positive).long()
    image = splat(
        torch.where(stays_in, there, here), torch.ones_like(events.t), (2 * batch, height, width), plane=plane
    )
    return image.view(batch, 2, height, width)
