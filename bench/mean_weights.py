"""The mean of the weights of several models of one shape.

python bench/mean_weights.py MODEL.safetensors... --out MEAN.safetensors
"""

import argparse
from pathlib import Path

import torch

from evimo.model.checkpoint import load_tensors, save_tensors


def main() -> None:
    """Parse, average, save; what the last model knows of itself comes along."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    loaded = [load_tensors(path) for path in options.models]
    facts = loaded[-1][1]
    if any(each["config"] != facts["config"] for _, each in loaded):
        raise SystemExit("the models differ in shape")
    mean = {name: torch.stack([tensors[name] for tensors, _ in loaded]).mean(0) for name in loaded[0][0]}
    save_tensors(mean, options.out, **facts, mean_of=len(loaded))


if __name__ == "__main__":
    main()
