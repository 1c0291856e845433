"""Score checkpoints of training runs and the mean of their weights; leave the mean as a model.

    python bench/average.py CHECKPOINT.safetensors... --validate FOLDER... --out OUT [--every 2]

`small` and `base` in the package are such means (docs/models.md). `evimo train` keeps its latest weights alone: copy
RUN/model.safetensors while it trains, at steps that RUN/validation.csv calls good; each file knows its step. Prints
the scores of `evimo train --validate` of each checkpoint, then those of the mean, in one table per folder, of one slice
in `--every`. `--by-truth` compensates by the truth, `--gyroscope` lets the model know the true rotation. OUT gets
`model.safetensors` and its ONNX files. Choose on recordings that no run has learned from, and keep those for a test
out of it, too.
"""

import argparse
from pathlib import Path
from typing import Any

import torch
from rich.console import Console
from rich.table import Table

from evimo.errors import BadInput, EvimoError
from evimo.model.checkpoint import load_model, load_tensors, save_model
from evimo.model.export import export
from evimo.model.networks import Model, network_of
from evimo.training.start import opened
from evimo.training.validation import validated
from evimo.writing import make_folder


def mean_of(paths: list[Path]) -> Model:
    """The model whose weights are the means of those of some checkpoints.

    Raises:
        BadInput: they have different shapes. NotFound, BadFile: as `load_model`.
    """
    models = [load_model(path) for path in paths]
    if odd := [path for path, model in zip(paths, models, strict=True) if model.config != models[0].config]:
        raise BadInput(f"{odd[0]} and {paths[0]} have different shapes", fix="checkpoints of one preset")
    mean = network_of(models[0].config).eval()
    states = [model.state_dict() for model in models]
    mean.load_state_dict({name: torch.stack([state[name] for state in states]).mean(0) for name in states[0]})
    return mean


def steps_of(paths: list[Path]) -> list[dict[str, Any]]:
    """Of which step of which run each checkpoint is."""
    facts = [load_tensors(path)[1] for path in paths]
    return [{name: fact.get(name) for name in ("step", "samples", "training")} for fact in facts]


def scored(models: dict[str, Model], folder: Path, **how: Any) -> Table:
    """The scores of each on the recordings of a folder."""
    recordings = opened([folder], lambda done, total: None)
    rows = {name: validated(model, recordings, **how) for name, model in models.items()}
    table = Table("", *next(iter(rows.values())), title=str(folder), title_justify="left")
    for name, scores in rows.items():
        table.add_row(name, *(f"{value:.3f}" for value in scores.values()))
    return table


def main() -> None:
    """Parse, average, score, export."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkpoints", type=Path, nargs="+")
    parser.add_argument("--validate", type=Path, nargs="*", default=[])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--every", type=int, default=2)
    parser.add_argument("--by-truth", action="store_true")
    parser.add_argument("--gyroscope", action="store_true")
    asked = parser.parse_args()
    try:
        mean = mean_of(asked.checkpoints)
        make_folder(asked.out)
        save_model(mean, asked.out / "model.safetensors", mean_of=steps_of(asked.checkpoints))
        export(mean, asked.out / "model.onnx")
        models = {str(path): load_model(path) for path in asked.checkpoints} | {"mean": mean}
        for folder in asked.validate:
            table = scored(models, folder, every=asked.every, oracle=asked.by_truth, gyroscope=asked.gyroscope)
            Console(width=150).print(table)
    except EvimoError as error:
        parser.exit(2, f"error: {error}\n")


if __name__ == "__main__":
    main()
