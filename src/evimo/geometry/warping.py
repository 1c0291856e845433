"""Inverse warp and splat: `sample`, `splat`, and the image of warped events. Torch, differentiable.

Convention: coordinates are (x, y) in px, integers are pixel centres, `align_corners=True`. This is the only file that
calls `grid_sample`.
"""

from typing import NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from evimo.geometry.grids import pixel_grid

_MARGIN = 2  # pixels around a splatted image, cut off afterwards: two of them hold all four neighbours of any outsider


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
    last = pixel_grid(image).amax(dim=(-2, -1))  # a tensor, so that an exported graph takes any size
    unit = at.permute(0, 2, 3, 1) * (2 / last.clamp(min=1)) - 1
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
    wide = width + 2 * _MARGIN
    corner = xy.detach().floor()
    right, down = (xy - corner).unbind(-1)
    column = corner[:, 0].long().clamp(-_MARGIN, width) + _MARGIN
    row = corner[:, 1].long().clamp(-_MARGIN, height) + _MARGIN
    first = (plane * (height + 2 * _MARGIN) + row) * wide + column
    four = torch.cat((first, first + 1, first + wide, first + wide + 1))
    left, up = (1 - right) * weight, 1 - down
    right = right * weight
    shares = torch.cat((left * up, right * up, left * down, right * down))
    image = weight.new_zeros(planes * (height + 2 * _MARGIN) * wide).index_add(0, four, shares)
    image = image.view(planes, height + 2 * _MARGIN, wide)
    return image[:, _MARGIN : _MARGIN + height, _MARGIN : _MARGIN + width]


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
    pixel = (events.batch * height + row) * width + column
    u, v = (component.flatten().index_select(0, pixel) for component in flow.unbind(1))
    x, y = events.x - events.t * u, events.y - events.t * v
    stays_in = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)
    xy = torch.stack((torch.where(stays_in, x, events.x), torch.where(stays_in, y, events.y)), dim=-1)
    plane = 2 * events.batch + (~events.positive).long()
    image = splat(xy, torch.ones_like(events.t), (2 * batch, height, width), plane=plane)
    return image.unflatten(0, (batch, 2))
