"""Train `tiny` with one thing changed, to measure what that thing does.

    python bench/variant.py FOLDER... --out RUN --steps 1000 [--shape first_layers=2] [--recipe moving_share=0.05]
    evimo evaluate HELD_OUT --model RUN/model.onnx

`--shape` changes a field of `ModelConfig`, `--recipe` one of the recipe `shipped`; values are JSON. Without either it
is the run to compare with: same seed, same batches. `--start FILE` trains a model further, not from nothing.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from rich.progress import track

from evimo.model.checkpoint import load_model
from evimo.model.export import export
from evimo.model.motion_net import MotionNet
from evimo.model.presets import PRESETS
from evimo.training.config import TrainConfig
from evimo.training.loop import Trainer
from evimo.training.recipes import RECIPES
from evimo.training.start import training_samples

VARIANT = "variant"


def changes(texts: list[str]) -> dict[str, Any]:
    """`name=value` as a dictionary."""
    return {name: json.loads(value) for name, _, value in (text.partition("=") for text in texts)}


def main() -> None:
    """Parse, train, export."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=1000)
    parser.add_argument("--learning-rate", type=float, default=4e-3)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--start", type=Path)
    parser.add_argument("--shape", nargs="*", default=[])
    parser.add_argument("--recipe", nargs="*", default=[])
    options = parser.parse_args()
    if options.start and options.shape:
        parser.error("a model that is trained further keeps its shape")
    RECIPES[VARIANT] = replace(RECIPES["shipped"], **changes(options.recipe))
    config = TrainConfig(recipe=VARIANT, steps=options.steps, learning_rate=options.learning_rate, seed=options.seed)
    torch.manual_seed(config.seed)
    shape = replace(PRESETS["tiny"], **changes(options.shape))
    model = load_model(options.start) if options.start else MotionNet(shape)
    samples = training_samples(options.folders, lambda done, total: None)
    trainer = Trainer(model, config, samples, options.out)
    trainer.resume()
    steps = iter(track(range(config.steps - trainer.step), description="train"))
    trainer.run(lambda step, terms: next(steps, None))
    export(trainer.averaged(), options.out / "model.onnx")


if __name__ == "__main__":
    main()
