"""Trained weights that come with the package: `<preset>.onnx` to run, `<preset>.safetensors` to train further."""

from pathlib import Path


def packaged(name: str, suffix: str) -> Path | None:
    """The packaged file of a preset, or None if there is none of that name."""
    path = Path(__file__).parent / f"{name}{suffix}"
    return path if path.is_file() and path.parent == Path(__file__).parent else None
