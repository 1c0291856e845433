"""Moving objects, depth and motion from the events of one moving event camera.

    for estimate in evimo.run("recording.aedat4", model="small"):
        print(estimate.t_us, [moving.box for moving in estimate.objects])

The public names are those of `__all__`; each is imported when it is first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from evimo.events.events import Events
    from evimo.formats.opening import open_events
    from evimo.geometry.calibration import load_camera
    from evimo.geometry.camera import Camera
    from evimo.model.checkpoint import load_model
    from evimo.recordings.estimate import Estimate
    from evimo.recordings.recording import open_recording
    from evimo.streaming.evaluating import evaluate
    from evimo.streaming.evaluating_predictions import evaluate_predictions
    from evimo.streaming.pipeline import run

__all__ = [
    "Camera",
    "Estimate",
    "Events",
    "evaluate",
    "evaluate_predictions",
    "load_camera",
    "load_model",
    "open_events",
    "open_recording",
    "run",
]

_HOMES = {
    "Camera": "evimo.geometry.camera",
    "Estimate": "evimo.recordings.estimate",
    "Events": "evimo.events.events",
    "evaluate": "evimo.streaming.evaluating",
    "evaluate_predictions": "evimo.streaming.evaluating_predictions",
    "load_camera": "evimo.geometry.calibration",
    "load_model": "evimo.model.checkpoint",
    "open_events": "evimo.formats.opening",
    "open_recording": "evimo.recordings.recording",
    "run": "evimo.streaming.pipeline",
}
_TRAINING_ONLY = {"load_model"}


def __getattr__(name: str) -> Any:
    """A public name, on first use.

    Raises:
        MissingExtra: it needs the extra `[train]`, which is not installed.
    """
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if name in _TRAINING_ONLY:
        from evimo.errors import check_installed

        check_installed(f"evimo.{name}", "torch", "safetensors", extra="train")
    found = getattr(import_module(_HOMES[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
