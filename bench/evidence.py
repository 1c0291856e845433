"""How well each motion candidate of the pose network explains the true flow, before any training.

    python bench/evidence.py FOLDER... [--slices 300]

FOLDER holds simulated recordings (`evimo simulate`). Printed is the mean error of compressed flow u / (1 + |u| / 3), in
px of half the image per slice, at pixels with events, by true speed; "no motion" is what a flow of zero gets, "best of
all" what choosing the best candidate at every pixel would get.
"""

import argparse
from pathlib import Path

import torch
from rich.console import Console
from rich.table import Table
from torch import Tensor
from torch.nn.functional import pad

from evimo.geometry.grids import resized_intrinsics
from evimo.model.backbone import enlarged, reduced
from evimo.model.evidence import evidence
from evimo.recordings.prepared import open_prepared, prepare, recording_folders
from evimo.training.data import batch_of, samples_of

NAMES = ("small window", "large window", "long baseline", "warped by the large window", "warped by a coarse image")
SPEEDS = {"all": (0.0, 1e9), "under 0.5": (0.0, 0.5), "0.5 to 2": (0.5, 2.0), "over 2": (2.0, 1e9)}
REDUCTION, STRIDE = 3, 18


def compressed(flow: Tensor) -> Tensor:
    """u / (1 + |u| / 3)."""
    return flow / (1 + flow.norm(dim=1, keepdim=True) / 3)


def sample_errors(folder: Path, slices: int) -> list[tuple[Tensor, Tensor]]:
    """Of some slices: errors (C + 2, N) of all candidates, of no motion and of the best, and true speeds (N,)."""
    recording = open_prepared(prepare(folder))
    samples = samples_of([recording])
    found: list[tuple[Tensor, Tensor]] = []
    for k in torch.linspace(2, len(samples) - 3, slices).round().int().tolist():
        batch = batch_of(samples, [k])
        right, down = -batch.frames.shape[-1] % STRIDE, -batch.frames.shape[-2] % STRIDE
        frames = pad(batch.frames, (0, right, 0, down))
        counts = reduced(frames[:, :, :2].flatten(1, 2), 2).log1p().unflatten(1, (5, 2))
        focal_px = resized_intrinsics(batch.intrinsics, (2, 2), (1, 1))[:, :2, None, None]
        truth = pad(batch.flow, (0, right, 0, down))[..., 1::2, 1::2] * focal_px / 40
        known = pad(batch.depth_valid & (batch.valid > 0), (0, right, 0, down))[:, 0, 1::2, 1::2]
        active = known & (counts[:, 2].sum(1) > 0)
        flows = [enlarged(motion, REDUCTION) for motion in evidence(counts, REDUCTION).motion.unbind(1)]
        errors = [(compressed(flow) - compressed(truth)).norm(dim=1)[active] for flow in (*flows, truth * 0)]
        stacked = torch.stack(errors)
        found.append((torch.cat((stacked, stacked[:-1].amin(0, keepdim=True))), truth.norm(dim=1)[active]))
    return found


def main() -> None:
    """Parse, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--slices", type=int, default=300)
    options = parser.parse_args()
    folders = recording_folders(options.folders)
    per_folder = 2
    chosen = folders[:: max(1, len(folders) * per_folder // options.slices)]
    parts = [part for folder in chosen for part in sample_errors(folder, per_folder)]
    errors, speed = torch.cat([part[0] for part in parts], dim=1), torch.cat([part[1] for part in parts])
    shares = [((speed >= low) & (speed < high)).float().mean().item() for low, high in SPEEDS.values()]
    table = Table("px of half the image per slice", *(f"{n} ({s:.0%})" for n, s in zip(SPEEDS, shares, strict=True)))
    for name, row in zip((*NAMES, "no motion", "best of all"), errors, strict=True):
        cells = (row[(speed >= low) & (speed < high)].mean().item() for low, high in SPEEDS.values())
        table.add_row(name, *(f"{cell:.3f}" for cell in cells))
    Console().print(f"simulated, {len(parts)} slices of {len(chosen)} recordings", table)


if __name__ == "__main__":
    main()
