"""The models that `--model` names, and how each of them gets from stacks of slices to answers."""

from pathlib import Path

from evimo.arguments import path_of
from evimo.geometry.rectification import Rectification
from evimo.streaming.four_parameters import CLASSICAL, Fits, FourParameters
from evimo.streaming.graphs import open_graph
from evimo.streaming.inference import Network
from evimo.streaming.one_look import OneLook, OneLookNetwork, looks_once
from evimo.streaming.passes import TwoPasses
from evimo.streaming.stopwatch import Stopwatch

Model = Network | OneLookNetwork | FourParameters


def model_of(name_or_path: str | Path) -> Model:
    """Return the model of that name, ready to run: a preset, an ONNX file, or `classical`.

    Raises:
        NotFound, BadFile: as `Network`. BadInput: it is neither a name nor a path.
    """
    if str(path_of(name_or_path, "a model")) == CLASSICAL:
        return FourParameters()
    graph = open_graph(name_or_path)
    return OneLookNetwork(graph) if looks_once(graph) else Network(graph)


def passes_of(model: Model, rectification: Rectification, stopwatch: Stopwatch) -> TwoPasses | OneLook | Fits:
    """Return what makes answers of stacks with that model."""
    if isinstance(model, FourParameters):
        return Fits(model, rectification, stopwatch)
    if isinstance(model, OneLookNetwork):
        return OneLook(model, rectification, stopwatch)
    return TwoPasses(model, rectification, stopwatch)
