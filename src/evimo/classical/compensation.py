"""The whole method for one slice: the world's motion, what does not fit it, and how that moves."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.classical.misfit import STEP, Misfit, misfit
from evimo.classical.regions import fitted_regions, flow_of
from evimo.classical.world import FINE_EVENTS, Scene, coarse_motion, fine_motion, shared

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters:
    """What was chosen on simulated recordings for training (docs/decisions/0009-classical-method.md).

    window:    slices to either side of the centre whose events the motions are fitted to.
    majority:  share of the picture that follows a motion of the camera at least; else it rests.
    threshold: misfit, in logs, from which on a place moves by itself.
    steepness: of the probability there, per log.
    supported: events per pixel of half the picture at which the confidence is 1 - 1/e.
    """

    window: float = 1.0
    majority: float = 0.15
    threshold: float = 1.8
    steepness: float = 2.0
    supported: float = 0.5


class Compensated(NamedTuple):
    """What the method says of one slice; maps of half the picture, (h, w).

    world:      (4,) motion of the static world about the scene's centre, as in `sharpness`, px per slice.
    moving:     probability that something is there that moves otherwise.
    flow:       (2, h, w) of everything, px of the picture per slice.
    own_flow:   (2, h, w) the same without that of the world; 0 where nothing moves by itself.
    confidence: 0...1, by how many events there are.
    """

    world: F8
    moving: F4
    flow: F4
    own_flow: F4
    confidence: F4


def compensate(scene: Scene, parameters: Parameters) -> Compensated:
    """Return the world's motion, what moves otherwise and how, from the events of one window."""
    world, found = world_and_misfit(scene, parameters)
    moving = _probability(found.score, parameters)
    numbers, motions = fitted_regions((moving > 0.5).view(np.uint8), scene, world)
    flow = flow_of(motions, numbers, scene.centre)
    own_flow = flow - flow_of(motions, np.zeros_like(numbers), scene.centre)
    confidence = np.float32(1) - np.exp(found.crowd / np.float32(-parameters.supported))
    return Compensated(world, moving, flow, own_flow, confidence)


def world_and_misfit(scene: Scene, parameters: Parameters) -> tuple[F8, Misfit]:
    """Return the world's motion (4,), from what fits it, 0 if the camera rests, and how badly each place fits."""
    few = scene.thinned(FINE_EVENTS)
    start = coarse_motion(few)
    moving = _probability(misfit(scene, start).score, parameters)
    row, column = ((each + np.float32(0.5)).astype(np.intp) // STEP for each in (few.y, few.x))
    found = fine_motion(few, 1 - moving[row, column], start)
    world = found if shared(few, found) > parameters.majority else np.zeros(4)
    return world, misfit(scene, world)


def _probability(score: F4, parameters: Parameters) -> F4:
    odds: F4 = np.exp(np.float32(parameters.steepness) * (score - np.float32(parameters.threshold)))
    return odds / (1 + odds)
