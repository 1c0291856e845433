"""The models that `--model` names, and how each of them gets from stacks of slices to answers."""

from pathlib import Path

from evimo.geometry.rectification import Rectification
from evimo.streaming.four_parameters import CLASSICAL, Fits, FourParameters
from evimo.streaming.inference import Network
from evimo.streaming.passes import TwoPasses
from evimo.streaming.stopwatch import Stopwatch

Model = Network | FourParameters


def model_of(name_or_path: str | Path) -> Model:
    """Return the model of that name, ready to run: a preset, an ONNX file, or `classical`.

    Raises:
        NotFound, BadFile: as `Network`.
    """
    return FourParameters() if str(name_or_path) == CLASSICAL else Network(name_or_path)


def passes_of(model: Model, rectification: Rectification, stopwatch: Stopwatch) -> TwoPasses | Fits:
    """Return what makes answers of stacks with that model."""
    if isinstance(model, FourParameters):
        return Fits(model, rectification, stopwatch)
    return TwoPasses(model, rectification, stopwatch)
