"""Trained weights that come with the package.

`<preset>.safetensors` to train further; `<preset>.onnx`, the second pass, and `<preset>.first.onnx` to run.
"""

from pathlib import Path

FIRST_PASS = ".first.onnx"


def packaged(name: str, suffix: str) -> Path | None:
    """The packaged file of a preset, or None if there is none of that name."""
    path = Path(__file__).parent / f"{name}{suffix}"
    return path if path.is_file() and path.parent == Path(__file__).parent else None


def first_pass_beside(path: Path) -> Path:
    """Where the first pass of the model at `path`, an ONNX file, is."""
    return path.with_name(f"{path.stem}{FIRST_PASS}")
