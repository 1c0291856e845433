"""What the camera of a simulated recording saw, made again: pictures are not stored."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from evimo.errors import EvimoError
from evimo.recordings.facts import own_version
from evimo.recordings.recording import Recording
from evimo.scene.renderer import Renderer
from evimo.simulate.own_folders import OwnFolders, own_folders_of
from evimo.simulate.plan import RecordingPlan, told_plan
from evimo.simulate.recording import SimulatedRecording, simulate_recording

Light = Callable[[int], NDArray[np.float32]]
"""From an instant in µs to its picture, (H, W) linear light."""

ALIKE = 0.999  # share of pixels with the same id in a picture made again


def pictures(recording: Recording) -> Light | None:
    """The pictures of a recording by instant, rendered from its seed; None where this version makes another one.

    Textures are not stored and nothing could tell them apart, so the version must be the same; lens, motion and ids
    are compared at the middle.

    Raises:
        NotFound: the folder of the user's own textures or meshes is gone or has changed.
    """
    if recording.meta.get("version") != own_version():
        return None
    again = _made_again(recording, own_folders_of(recording.meta))
    if again is None:
        return None
    renderer, middle = Renderer(again.scene, again.camera), len(recording) // 2
    made, kept = renderer.truth(int(recording.times_us[middle])), recording.truth(middle)
    alike = again.camera == recording.camera and np.allclose(made.ego, kept.ego)
    if not alike or (made.ids == kept.ids).mean() < ALIKE:
        return None
    return lambda t_us: renderer.frames(np.array([t_us * 1e-6])).image[0]


def _made_again(recording: Recording, own: OwnFolders) -> SimulatedRecording | None:
    told = told_plan(recording.meta)
    told["device"] = "cpu"  # renders alike
    try:
        return simulate_recording(RecordingPlan(**told, own=own))
    except (KeyError, TypeError, ValueError, EvimoError):
        return None
