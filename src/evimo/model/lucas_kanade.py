"""Local motion of event frames by least squares (Lucas and Kanade, 1981), inside the graph and without parameters.

Counts and mean times alone make a small network a detector of density; products of spatial and temporal differences
are what it cannot form by itself. Each polarity is one brightness-like channel, log(1 + count): its change from slice
to slice and its slope in x and y give, over a window, the displacement that explains both.
"""

from math import exp
from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import conv2d, pad

from evimo.model.backbone import reduced


def gaussian(sigma_px: float) -> list[float]:
    """One-dimensional kernel that sums to 1."""
    reach = int(2.5 * sigma_px + 0.5)
    heights = [exp(-0.5 * (step / sigma_px) ** 2) for step in range(-reach, reach + 1)]
    return [height / sum(heights) for height in heights]


def smoothed(image: Float[Tensor, "B C H W"], sigma_px: float) -> Float[Tensor, "B C H W"]:
    """Gaussian blur; outside the image is zero."""
    kernel = image.new_tensor(gaussian(sigma_px))
    reach = len(kernel) // 2
    planes = image.flatten(0, 1)[:, None]  # every channel by itself
    planes = conv2d(planes, kernel.view(1, 1, 1, -1), padding=(0, reach))
    planes = conv2d(planes, kernel.view(1, 1, -1, 1), padding=(reach, 0))
    return planes.view_as(image)


def differences(image: Float[Tensor, "B C H W"]) -> tuple[Tensor, Tensor]:
    """Central differences in x and y, per px; outside the image is zero."""
    wide, high = pad(image, (1, 1, 0, 0)), pad(image, (0, 0, 1, 1))
    return (wide[..., 2:] - wide[..., :-2]) / 2, (high[..., 2:, :] - high[..., :-2, :]) / 2


class Products(NamedTuple):
    """Products of the slopes, summed over both polarities, (B, 1, H, W) each; additive, so any window is an average.

    Slopes in x and y per px, in t per slice.
    """

    xx: Tensor
    xy: Tensor
    yy: Tensor
    xt: Tensor
    yt: Tensor
    tt: Tensor

    def windowed(self, reduction: int, sigma_px: float) -> "Products":
        """Averages over reduction x reduction pixels, then Gaussian windows of `sigma_px` of those."""
        return Products(*smoothed(reduced(torch.cat(self, dim=1), reduction), sigma_px).split(1, dim=1))

    def plus(self, other: "Products") -> "Products":
        """The evidence of both."""
        return Products(*(a + b for a, b in zip(self, other, strict=True)))


def products(before: Tensor, here: Tensor, after: Tensor, *, slices: float = 2.0) -> Products:
    """Products from three images (B, 2, H, W) of both polarities; `slices` is the time from `before` to `after`."""
    x, y = differences((before + 2 * here + after) / 4)
    t = (after - before) / slices
    pairs = ((x, x), (x, y), (y, y), (x, t), (y, t), (t, t))
    return Products(*((a * b).sum(1, keepdim=True) for a, b in pairs))


def local_motion(found: Products) -> Float[Tensor, "B 2 H W"]:
    """Displacement (x, y) per slice that explains each window best, in px of the images the products came from.

    A ridge pulls it towards 0 where there is little contrast, or along an edge: the aperture problem.
    """
    contrast = found.xx + found.yy
    ridge = 0.05 * contrast.mean(dim=(-2, -1), keepdim=True) + 0.02 * contrast + 1e-6
    xx, yy = found.xx + ridge, found.yy + ridge
    motion = torch.cat((found.xy * found.yt - yy * found.xt, found.xy * found.xt - xx * found.yt), dim=1)
    return motion / (xx * yy - found.xy * found.xy)


def trust(found: Products) -> Float[Tensor, "B 3 H W"]:
    """How much contrast there is, how evenly it is spread over both directions, how much still changes: 0...1 each."""
    contrast = found.xx + found.yy
    mean = contrast.mean(dim=(-2, -1), keepdim=True) + 1e-6
    spread = 4 * (found.xx * found.yy - found.xy * found.xy) / (contrast + 0.01 * mean) ** 2
    return torch.cat((contrast / (contrast + mean), spread, found.tt / (found.tt + contrast + 0.1 * mean)), dim=1)


def directional_trust(found: Products) -> Float[Tensor, "B 3 H W"]:
    """How much each window tells of its motion in each direction: a symmetric matrix (xx, xy, yy) of trace below 1."""
    contrast = found.xx + found.yy
    scale = contrast + 0.3 * contrast.mean(dim=(-2, -1), keepdim=True) + 1e-6
    return torch.cat((found.xx, found.xy, found.yy), dim=1) / scale
