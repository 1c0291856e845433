"""`--model classical`: the four-parameter method of the room `classical` in the place of the networks.

It runs on any recording without weights, and answers what it can: one plane at the mean depth, along which the camera
moves and which it turns before about the optical axis. Roll and pitch look like shifts to it, and what moves has no
depth of its own and no speed towards the camera.
"""

from collections.abc import Callable, Generator
from dataclasses import asdict
from typing import Any

import numpy as np

from evimo.classical.compensation import Compensated, Parameters, compensate
from evimo.classical.sharpness import ARM
from evimo.classical.world import Scene
from evimo.formats.event_file import EventFile
from evimo.geometry.rectification import Rectification
from evimo.streaming.graphs import workers_here
from evimo.streaming.inference import Answer
from evimo.streaming.passes import Stacked, near
from evimo.streaming.rotation import SLICE_S, Rotation
from evimo.streaming.span import Span
from evimo.streaming.stopwatch import Stopwatch
from evimo.streaming.threads import in_parallel

CLASSICAL = "classical"


class FourParameters:
    """The training-free method as a model: beside a network's it has parameters instead of weights.

    name: always `classical`. workers: slices that run side by side. parameters: of the method.
    """

    finds_objects = True

    def __init__(self, parameters: Parameters | None = None, *, workers: int | None = None) -> None:
        """The parameters are the ones that were chosen, unless given."""
        self.name = CLASSICAL
        self.parameters = parameters or Parameters()
        self.workers = workers_here(workers)

    @property
    def config(self) -> dict[str, Any]:
        """The parameters by name."""
        return asdict(self.parameters)

    @property
    def identity(self) -> dict[str, str]:
        """What tells its results from those of other models and parameters."""
        return {"parameters": ", ".join(f"{name} {value:g}" for name, value in self.config.items())}


class Fits:
    """The method over a recording's stacks, a fit of its own for each slice; beside `TwoPasses` of networks."""

    def __init__(self, model: FourParameters, rectification: Rectification, stopwatch: Stopwatch) -> None:
        self._parameters, self._workers = model.parameters, model.workers
        self._image = rectification.image
        self._stopwatch = stopwatch

    def answers(
        self, stacks: Generator[Stacked], span: Span, rotation: Rotation
    ) -> Generator[tuple[Stacked, Answer | None]]:
        """Each slice of the span, and a neighbour to each side, with the method's answer; rotation has no use here."""
        return in_parallel(self._answered, near(stacks, span), workers=self._workers)

    def rotation(self, events: EventFile, stacks: Callable[[], Generator[Stacked]]) -> Rotation:
        """What is known of the camera's rotation: nothing is taken from gyroscopes."""
        return Rotation(None, "not used: the classical method sees the events alone")

    def _answered(self, stacked: Stacked) -> tuple[Stacked, Answer | None]:
        if not len(stacked.part.events):
            return stacked, None
        stack, image = stacked.stack, self._image
        with self._stopwatch.stage("four parameters"):
            near = np.abs(stack.t) <= self._parameters.window
            scene = Scene(stack.x[near], stack.y[near], stack.t[near], image.size, (image.cx, image.cy))
            return stacked, _answer_of(compensate(scene, self._parameters), (image.fx, image.fy))


def _answer_of(found: Compensated, focal_px: tuple[float, float]) -> Answer:
    """Px per slice as motions of one plane at depth 1: `geometry.motion_field` without roll and pitch, backwards."""
    per_second = np.array(focal_px) * SLICE_S
    (u, v), (expansion, turn) = found.world[:2] / per_second, found.world[2:] / (ARM * SLICE_S)
    on_plane = np.reciprocal(per_second).astype(np.float32)[:, None, None]
    return Answer(
        moving=found.moving,
        rel_depth=np.ones_like(found.moving),
        ego=np.array((-u, -v, expansion, 0.0, 0.0, -turn)),
        velocity=np.stack((*(found.own_flow * on_plane), np.zeros_like(found.moving))),
        flow=found.flow * on_plane,
        confidence=found.confidence,
    )
