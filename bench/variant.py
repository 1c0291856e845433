"""Train a network with one thing changed, to measure what that thing does; the scores go to OUT/validation.csv.

    python bench/variant.py FOLDER... --validate FOLDER --out RUN --steps 500 [--preset tiny] [--recipe paper]
        [--shape objects=1] [--terms mask_one_sided=0 mask=1] [--slices 3]

`--shape` changes fields of the preset's shape, `--terms` weights of the recipe's loss terms, of both passes where both
have them, and `--moving-share` the recipe's. `--slices` is how many slices there are to see; the others are missing.
Values are JSON. Without any it is the run to compare with: same seed, same batches, same first weights if the shape is
the same. `--start FILE` trains a model further, not from nothing. The same command again goes on where it stopped, and
another one in the same folder is refused.
"""

import argparse
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from rich.progress import track

from evimo.events.stack import EventStack
from evimo.model.checkpoint import load_model
from evimo.model.export import export
from evimo.model.networks import Model, network_of
from evimo.model.presets import PRESETS
from evimo.recordings.prepared import Prepared
from evimo.training import data, validation
from evimo.training.config import TrainConfig
from evimo.training.curves import open_curves
from evimo.training.loop import Trainer
from evimo.training.recipes import RECIPES, Recipe
from evimo.training.sources import from_folders
from evimo.training.start import opened, training_samples


def changes(texts: list[str]) -> dict[str, Any]:
    """`name=value` as a dictionary."""
    return {name: json.loads(value) for name, _, value in (text.partition("=") for text in texts)}


def changed(recipe: Recipe, terms: dict[str, float], moving_share: float | None) -> Recipe:
    """The recipe with other weights; a term that the first pass does not have stays out of it."""
    first = recipe.first | {name: weight for name, weight in terms.items() if name in recipe.first}
    share = recipe.moving_share if moving_share is None else moving_share
    return replace(recipe, first=first, weights=recipe.weights | terms, moving_share=share)


def few(stack_of: Callable[..., EventStack], slices: int) -> Callable[..., EventStack]:
    """The same stacks with so many slices at most."""

    def stack(recording: Prepared, middle: int, *, reach: int = data.HALF) -> EventStack:
        return stack_of(recording, middle, reach=min(reach, slices // 2))

    return stack


def options() -> argparse.Namespace:
    """What the command asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--validate", type=Path, nargs="*", default=[])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--preset", default="tiny", choices=list(PRESETS))
    parser.add_argument("--recipe", default="shipped", choices=list(RECIPES))
    parser.add_argument("--steps", type=int, default=1000)
    parser.add_argument("--learning-rate", type=float, default=4e-3)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--start", type=Path)
    parser.add_argument("--shape", nargs="*", default=[])
    parser.add_argument("--terms", nargs="*", default=[])
    parser.add_argument("--moving-share", type=float)
    parser.add_argument("--slices", type=int, default=5, choices=[1, 3, 5])
    asked = parser.parse_args()
    if asked.start and asked.shape:
        parser.error("a model that is trained further keeps its shape")
    return asked


def main() -> None:
    """Parse, train, score, export."""
    asked = options()
    variant = f"variant of {asked.recipe}, {asked.slices} slices"
    RECIPES[variant] = changed(RECIPES[asked.recipe], changes(asked.terms), asked.moving_share)
    data.stack_of = validation.stack_of = few(data.stack_of, asked.slices)
    config = TrainConfig(recipe=variant, steps=asked.steps, learning_rate=asked.learning_rate, seed=asked.seed)
    torch.manual_seed(config.seed)
    shape = replace(PRESETS[asked.preset], **changes(asked.shape))
    model: Model = load_model(asked.start) if asked.start else network_of(shape)
    samples = training_samples(asked.folders, lambda done, total: None)
    trainer = Trainer(model, config, from_folders(samples), asked.out, data=samples.fingerprint())
    trainer.resume()
    recordings = opened(asked.validate, lambda done, total: None) if asked.validate else []
    steps = iter(track(range(config.steps - trainer.step), description="train"))
    asked.out.mkdir(parents=True, exist_ok=True)
    with open_curves(asked.out, recordings, step=trainer.step) as curves:

        def report(step: int, terms: dict[str, float]) -> None:
            curves.learned(step, terms)
            next(steps, None)

        trainer.run(report)
        if recordings:
            curves.validate(config.steps, trainer.averaged())
    export(trainer.averaged(), asked.out / "model.onnx")


if __name__ == "__main__":
    main()
