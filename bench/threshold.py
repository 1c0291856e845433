"""Where to cut the moving probability: scores over thresholds on recordings, and a model moved so that ½ is the cut.

    python bench/threshold.py MODEL.safetensors FOLDER... [--every 5] [--move-to 0.6 --out MOVED.safetensors]

The mask loss is balanced for small objects, so it calls too much moving. Choose the cut on training recordings, never
on those that are evaluated. `--move-to T` raises the background's logit of the finest scale by log(T / (1 - T)).
"""

import argparse
from math import log
from pathlib import Path
from typing import NamedTuple

import torch
from rich.console import Console
from rich.table import Table
from torch.nn.functional import interpolate

from evimo.model.checkpoint import load_model, load_tensors, save_tensors
from evimo.model.motion_net import MotionNet
from evimo.recordings.prepared import open_prepared, prepare, recording_folders
from evimo.training.data import batch_of, samples_of

THRESHOLDS = (0.3, 0.4, 0.5, 0.55, 0.6, 0.65, 0.7, 0.8)
LEAST_PX = 10  # a slice with fewer moving pixels has no mover in sight


class Sample(NamedTuple):
    """By threshold: pixels in both masks, in either, share of events called moving; and whether there is a mover."""

    both: torch.Tensor
    either: torch.Tensor
    called: torch.Tensor
    has_mover: bool


def samples(model: MotionNet, folder: Path) -> list[Sample]:
    """Three slices of a recording, at every threshold."""
    recording = samples_of([open_prepared(prepare(folder))])
    chosen = sorted({len(recording) // 5, len(recording) // 2, 4 * len(recording) // 5})
    batch = batch_of(recording, chosen)
    with torch.no_grad():
        background = model(batch.frames, batch.valid, batch.intrinsics)[-1].mixture[:, :1]
    height, width = batch.frames.shape[-2:]
    moving = interpolate(1 - background, scale_factor=2.0, mode="bilinear")[..., :height, :width]
    inside, events = batch.valid > 0, batch.frames[:, 2, :2].sum(1, keepdim=True)
    called = (moving[None] > torch.tensor(THRESHOLDS).view(-1, 1, 1, 1, 1)) & inside
    truth = batch.moving & inside
    both, either = (called & truth).sum((2, 3, 4)), (called | truth).sum((2, 3, 4))
    shares = (called * events).sum((2, 3, 4)) / events.sum((1, 2, 3)).clamp(min=1)
    movers = (truth.sum((1, 2, 3)) >= LEAST_PX).tolist()
    return [Sample(both[:, k], either[:, k], shares[:, k], movers[k]) for k in range(len(movers))]


def table(found: list[Sample]) -> Table:
    """One row per threshold."""
    with_movers, without = ([one for one in found if one.has_mover is wanted] for wanted in (True, False))
    both, either = (torch.stack([getattr(one, name) for one in with_movers]) for name in ("both", "either"))
    called = torch.stack([one.called for one in without]).mean(0)
    title = f"{len(with_movers)} slices with movers, {len(without)} without"
    result = Table("threshold", "IoU, pooled", "IoU, mean", "events called moving without movers", title=title)
    for k, threshold in enumerate(THRESHOLDS):
        pooled, mean = both[:, k].sum() / either[:, k].sum(), (both[:, k] / either[:, k]).mean()
        result.add_row(f"{threshold:g}", f"{pooled:.3f}", f"{mean:.3f}", f"{called[k]:.3f}")
    return result


def move(source: Path, target: Path, threshold: float) -> None:
    """Save a model whose ½ is where the other's threshold was."""
    tensors, facts = load_tensors(source)
    finest = max(name for name in tensors if name.endswith(".mask_head.bias"))
    tensors[finest] = tensors[finest].clone()
    tensors[finest][0] += log(threshold / (1 - threshold))
    save_tensors(tensors, target, **facts, moved_to=threshold)


def main() -> None:
    """Parse, measure, print; move."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--every", type=int, default=5, help="one recording in so many")
    parser.add_argument("--move-to", type=float)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    if bool(options.move_to) != bool(options.out):
        parser.error("--move-to and --out go together")
    model = load_model(options.model)
    found = [one for folder in recording_folders(options.folders)[:: options.every] for one in samples(model, folder)]
    Console().print(table(found))
    if options.move_to and options.out:
        move(options.model, options.out, options.move_to)


if __name__ == "__main__":
    main()
