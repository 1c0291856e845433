"""How fast each preset learns: samples per second of the step alone, and of a run with data, with its share of waiting.

python bench/training.py [--device cuda] [--batch 64]
"""

import argparse
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

PRESETS = ("tiny", "small", "base")
STEPS = 6
SIZE = (260, 346)


def random_recording() -> Any:
    """Slices with random events and truth: what they cost does not depend on what they show."""
    from evimo.recordings.prepared import SUBPIXEL, Prepared

    slices, events, rng = 6, 12_000, np.random.default_rng(0)
    shape = (slices, *SIZE)
    ids = (rng.random(shape) < 0.05).astype(np.uint8)
    return Prepared(
        intrinsics=np.array((258, 258, 173, 130), np.float32),
        valid=np.ones(SIZE, bool),
        depth=rng.uniform(1, 3, shape).astype(np.float16),
        ids=ids,
        moving=ids > 0,
        clutter=ids > 1,
        flow=rng.normal(size=(slices, 2, *SIZE)).astype(np.float16),
        velocity=np.zeros((slices, 256, 3), np.float32),
        ego=(0.3 * rng.normal(size=(slices, 6))).astype(np.float32),
        event_xy=(rng.random((slices * events, 2)) * (SIZE[1] - 1, SIZE[0] - 1) * SUBPIXEL).astype(np.uint16),
        event_t=np.sort(rng.integers(0, 25_000, (slices, events)), axis=1).ravel().astype(np.uint16),
        event_on=rng.random(slices * events) < 0.5,
        event_first=np.arange(slices + 1) * events,
    )


def samples_per_s(preset: str, device: str, batch: int) -> float:
    """Samples per second of the step alone: the same batch again and again."""
    import torch

    from evimo.model.motion_net import MotionNet
    from evimo.model.presets import PRESETS as SHAPES
    from evimo.training.config import TrainConfig
    from evimo.training.data import drawn_row, samples_of, stacked
    from evimo.training.devices import ALONE, training_device
    from evimo.training.learner import Learner

    torch.manual_seed(0)
    samples, rng = samples_of([random_recording()]), np.random.default_rng(0)
    drawn = stacked([drawn_row(samples, rng) for _ in range(batch)])
    drawn = drawn.pinned() if device == "cuda" else drawn
    learner = Learner(MotionNet(SHAPES[preset]).to(training_device(device)), TrainConfig(batch=batch), ALONE)
    learner.learn(drawn, rate=1e-4, keep=0.9)
    begun_s = time.perf_counter()
    for _ in range(STEPS):
        learner.learn(drawn, rate=1e-4, keep=0.9)  # asks for the loss, and with it for the end of the step
    return STEPS * batch / (time.perf_counter() - begun_s)


def with_data(preset: str, device: str, batch: int) -> tuple[float, float]:
    """Samples per second of a run, batches drawn beside it, and the share of the time that it waits for them."""
    import torch

    from evimo.model.motion_net import MotionNet
    from evimo.model.presets import PRESETS as SHAPES
    from evimo.training.config import TrainConfig
    from evimo.training.data import samples_of
    from evimo.training.devices import training_device
    from evimo.training.loop import Trainer
    from evimo.training.sources import from_folders

    torch.manual_seed(0)
    model = MotionNet(SHAPES[preset]).to(training_device(device))
    config, source = TrainConfig(batch=batch, steps=STEPS + 1), from_folders(samples_of([random_recording()]))
    with tempfile.TemporaryDirectory() as out:
        trainer = Trainer(model, config, source, Path(out))
        paces: list[tuple[float, float]] = []
        trainer.run(lambda *_: paces.append((trainer.pace.samples_per_s, trainer.pace.waited)))
    return paces[-1]


def training_rows(device: str = "cpu", batch: int = 8) -> Iterator[dict[str, Any]]:
    """Rows of `bench/speed.py`."""
    for preset in PRESETS:
        alone, (beside, waited) = samples_per_s(preset, device, batch), with_data(preset, device, batch)
        note = f"{device}, batch {batch}, crops of recordings of {SIZE[1]}x{SIZE[0]}; the step alone {alone:.1f}"
        yield {"key": f"train_{preset}_samples_per_s", "value": beside, "unit": "samples/s", "note": note}
        yield {"key": f"train_{preset}_waiting", "value": waited, "unit": "of the time", "note": "for data"}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu")
    parser.add_argument("--batch", type=int, default=8)
    options = parser.parse_args()
    for row in training_rows(options.device, options.batch):
        print(f"{row['key']:32} {row['value']:8.2f} {row['unit']}, {row['note']}")


if __name__ == "__main__":
    main()
