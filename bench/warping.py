"""Fine warp loss, forward and backward: splatting events against warping 25 images of 1 ms with grid_sample.

    python bench/warping.py

Both ways run in turn, and medians of the same run are compared: absolute times mean little on a shared machine.
"""

import statistics
import time
from collections.abc import Callable
from typing import Any

import torch

from evimo.geometry.grids import pixel_grid
from evimo.geometry.warping import EventPoints, sample
from evimo.losses.warp import fine_warp_loss, sharpness

SIZE = (260, 346)
SLICE_S = 0.025
THIN_SLICES = 25
GOALS = {1: (5.0, 20.0), 8: (10.0, 50.0)}  # batch: must, aim; docs of the project's goals


def slice_events(batch: int, per_slice: int, generator: torch.Generator) -> EventPoints:
    """Random events at whole pixels, sorted by time within each sample, as a sensor gives them."""
    height, width = SIZE
    count = batch * per_slice
    t = (torch.rand(batch, per_slice, generator=generator).sort(dim=1).values.flatten() - 0.5) * SLICE_S
    return EventPoints(
        torch.arange(batch).repeat_interleave(per_slice),
        torch.randint(0, width, (count,), generator=generator).float(),
        torch.randint(0, height, (count,), generator=generator).float(),
        t,
        torch.rand(count, generator=generator) > 0.5,
    )


def thin_slices(events: EventPoints, batch: int) -> torch.Tensor:
    """Counts by polarity of each 1 ms, (B, 25, 2, H, W)."""
    height, width = SIZE
    images = torch.zeros(batch, THIN_SLICES, 2, height, width)
    thin = ((events.t / SLICE_S + 0.5) * THIN_SLICES).long().clamp(0, THIN_SLICES - 1)
    at = (events.batch, thin, (~events.positive).long(), events.y.long(), events.x.long())
    return images.index_put_(at, torch.ones(len(thin)), accumulate=True)


def by_grid_sample(flow: torch.Tensor, images: torch.Tensor) -> torch.Tensor:
    """The same loss the way the paper words it: warp every thin slice to the middle, add, take the quasi-norm."""
    batch, thin = images.shape[:2]
    elapsed_s = ((torch.arange(thin) + 0.5) / thin - 0.5) * SLICE_S
    at = pixel_grid(flow) + flow[:, None] * elapsed_s.view(1, -1, 1, 1, 1)
    stacked = sample(images.flatten(0, 1), at.flatten(0, 1)).unflatten(0, (batch, thin)).sum(1)
    count = images.sum(dim=(1, 2, 3, 4)).view(-1, 1, 1, 1)
    return 2 * SIZE[0] * SIZE[1] / count * sharpness(stacked)


def medians_ms(ways: dict[str, Callable[[], Any]], rounds: int) -> dict[str, float]:
    """Each way once per round, in turn; the median of its times."""
    times: dict[str, list[float]] = {name: [] for name in ways}
    for way in ways.values():
        way()
    for _ in range(rounds):
        for name, way in ways.items():
            start = time.perf_counter()
            way()
            times[name].append((time.perf_counter() - start) * 1e3)
    return {name: statistics.median(each) for name, each in times.items()}


def warping_row(batch: int, per_slice: int, *, rounds: int = 7) -> dict[str, Any]:
    """One comparison at 346x260; `value` is how many times faster the splat is."""
    generator = torch.Generator().manual_seed(0)
    events = slice_events(batch, per_slice, generator)
    images = thin_slices(events, batch)
    coarse = torch.randn(batch, 2, 5, 7, generator=generator) * 4 / SLICE_S
    flow = torch.nn.functional.interpolate(coarse, SIZE, mode="bicubic").requires_grad_()

    def step(loss: Callable[[], torch.Tensor]) -> None:
        flow.grad = None
        loss().mean().backward()

    splat, peer = (lambda: fine_warp_loss(flow, events)), (lambda: by_grid_sample(flow, images))
    ms = medians_ms({"splat": lambda: step(splat), "grid_sample": lambda: step(peer)}, rounds)
    must, aim = GOALS.get(batch, (0.0, 0.0))
    return {
        "key": f"fine_warp_vs_grid_sample_batch_{batch}",
        "value": ms["grid_sample"] / ms["splat"],
        "must": must,
        "aim": aim,
        "batch": batch,
        "events_per_slice": per_slice,
        "splat_ms": ms["splat"],
        "grid_sample_ms": ms["grid_sample"],
        "loss_splat": splat().mean().item(),
        "loss_grid_sample": peer().mean().item(),
    }


def warping_rows() -> list[dict[str, Any]]:
    """Batch 1 and 8 at 20,000 events per slice."""
    return [warping_row(batch, 20_000) for batch in GOALS]


def main() -> None:
    """Print the rows."""
    from rich.console import Console
    from rich.table import Table

    table = Table("batch", "events/slice", "splat ms", "grid_sample ms", "times faster", "must", "aim", "losses")
    for row in warping_rows():
        numbers = (f"{row[name]:.1f}" for name in ("splat_ms", "grid_sample_ms", "value", "must", "aim"))
        losses = f"{row['loss_splat']:.4f} {row['loss_grid_sample']:.4f}"
        table.add_row(str(row["batch"]), str(row["events_per_slice"]), *numbers, losses)
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
