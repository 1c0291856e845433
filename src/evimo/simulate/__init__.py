"""This room makes recordings with exact truth from a scene and a model of an event camera's pixels.

`recording.simulate_recording` makes one from its `plan.RecordingPlan`, `dataset.simulate_dataset` many.
"""

from evimo.simulate.dataset import simulate_dataset
from evimo.simulate.recording import simulate_recording

__all__ = ["simulate_dataset", "simulate_recording"]
