"""Motion without labels: slices warped along the right flow agree (coarse), and their events pile up (fine)."""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from evimo.geometry.grids import pixel_grid
from evimo.geometry.warping import EventPoints, image_of_warped_events, inside, sample


def coarse_warp_loss(
    counts: Float[Tensor, "B N C H W"],
    flow: Float[Tensor, "B 2 H W"],
    valid: Bool[Tensor, "B 1 H W"],
    *,
    elapsed_s: Float[Tensor, " N"],
) -> Float[Tensor, "B 1 H W"]:
    """Mean |difference| in event counts of the inversely warped neighbours and the middle slice (paper, coarse loss).

    Where a neighbour would be read outside the frame or at an invalid pixel, its unwarped difference stands: looking
    away pays no better than claiming no motion. A neighbour without any event is a missing one and takes no part.

    Args:
        counts: of events, of N slices in order, N odd; C is one channel for each polarity.
        flow: px/s at the centre of the middle slice.
        valid: pixels the lens can see; 0 elsewhere.
        elapsed_s: time of each slice's centre relative to the middle one's; the middle entry is ignored.
    """
    batch, slices, _, height, width = counts.shape
    middle = counts[:, slices // 2]
    here = pixel_grid(flow)
    total = flow.new_zeros(batch, 1, height, width)
    count = flow.new_zeros(batch, 1, 1, 1)
    for n in range(slices):
        if n == slices // 2:
            continue
        at = here + flow * elapsed_s[n]
        seen = inside(at, (height, width)) & (sample(valid.to(flow), at.detach()) > 0.999)
        warped = torch.where(seen, sample(counts[:, n], at), counts[:, n])
        present = counts[:, n].ne(0).flatten(1).any(1).to(flow).view(-1, 1, 1, 1)
        total = total + present * (warped - middle).abs().mean(dim=1, keepdim=True)
        count = count + present
    return torch.where(valid, total / count.clamp(min=1), 0)


def sharpness(
    image: Float[Tensor, "*batch H W"], *, power: float = 0.5, epsilon: float = 1e-4
) -> Float[Tensor, "*batch H W"]:
    """(S + epsilon)^power - epsilon^power per pixel: the sparse quasi-norm, with a finite gradient at S = 0."""
    return (image + epsilon) ** power - epsilon**power


def fine_warp_loss(
    flow: Float[Tensor, "B 2 H W"], events: EventPoints, *, power: float = 0.5, epsilon: float = 1e-4
) -> Float[Tensor, "B 2 H W"]:
    """Sharpness of the image of warped events, per polarity, times pixels per event (paper, fine loss).

    Its mean over the image's pixels is, per event, about 1 where no two events meet and n^(power - 1) where n of them
    do. It counts every event always (`image_of_warped_events`), so that warping content out of the frame gains
    nothing. The paper warps 25 images of 1 ms; each event by its own time is the limit of that and much cheaper.

    Args:
        flow: px/s at the reference time of the events.
        events: of the same batch; a sample without any costs 0.
        power: p of the paper, 0 < p < 1.
        epsilon: events; smooths the power near 0.
    """
    image = image_of_warped_events(flow, events)
    count = image.detach().sum(dim=(1, 2, 3), keepdim=True)
    pixels_per_event = image.shape[-2] * image.shape[-1] / count.clamp(min=1)
    return 2 * pixels_per_event * sharpness(image, power=power, epsilon=epsilon)
