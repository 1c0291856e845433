"""Where each pixel looks: normalised grids and the intrinsics of resized images, torch, exportable.

Convention: integer coordinates are pixel centres; intrinsics are (fx, fy, cx, cy) in px; sizes are (height, width).
"""

import torch
from jaxtyping import Float
from torch import Tensor


def pixel_grid(image: Float[Tensor, "*batch C H W"]) -> Float[Tensor, "2 H W"]:
    """Column and row of each pixel of an image, px.

    Counted from the values, not from the shape: an exporter may freeze a shape, and the graph must take any.
    """
    while image.dim() > 2:
        image = image[0]
    column, row = image[:1] * 0, image[:, :1] * 0
    return torch.stack((row + ((column + 1).cumsum(-1) - 1), column + ((row + 1).cumsum(-2) - 1)))


def normalised_grid(
    intrinsics: Float[Tensor, "*batch 4"], image: Float[Tensor, "*any C H W"]
) -> Float[Tensor, "*batch 2 H W"]:
    """(x, y) on the plane Z = 1 of each pixel of a pinhole image.

    Args:
        intrinsics: fx, fy, cx, cy in px, of this very image size.
        image: any finite image of that size.
    """
    focal_px, centre = intrinsics[..., :2, None, None], intrinsics[..., 2:, None, None]
    return (pixel_grid(image).to(intrinsics) - centre) / focal_px


def resized_intrinsics(
    intrinsics: Float[Tensor, "*batch 4"], size: tuple[int, int], new_size: tuple[int, int]
) -> Float[Tensor, "*batch 4"]:
    """Intrinsics after the image was resized from `size` to `new_size`, both (height, width).

    The true ratios of the sizes count, which differ by axis where a size was rounded; a scale of s moves the
    principal point to s * (c + 1/2) - 1/2.
    """
    (height, width), (new_height, new_width) = size, new_size
    fx, fy, cx, cy = intrinsics.unbind(-1)
    by_x, by_y = new_width / width, new_height / height
    return torch.stack((fx * by_x, fy * by_y, by_x * (cx + 0.5) - 0.5, by_y * (cy + 0.5) - 0.5), dim=-1)
