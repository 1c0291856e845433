"""`summary.json`: what a run did, with what, how fast, and what it left out."""

import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from typing import Any

from evimo.streaming.pipeline import Run

LIBRARIES = ("evimo", "numpy", "numba", "onnxruntime", "opencv-python-headless", "h5py", "av")


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """How a run went.

    slices:      finished.
    startup_s:   from opening the outputs to the first estimate.
    running_s:   from there until the last output was complete.
    interrupted: stopped by the user before the end of its span.
    """

    slices: int
    startup_s: float
    running_s: float
    interrupted: bool

    @property
    def slices_per_s(self) -> float:
        """Slices after the first one, over the time after it; 0 where there is one only."""
        return (self.slices - 1) / self.running_s if self.slices > 1 and self.running_s > 0 else 0.0


def summary(run: Run, course: Course, *, settings: dict[str, Any], warnings: Sequence[str]) -> dict[str, Any]:
    """Everything worth keeping of a run, ready for JSON. Times in s or as named; `stages_ms` is per slice."""
    events, rectification = run.events, run.rectification
    return {
        "versions": {"python": platform.python_version()} | {name: version(name) for name in LIBRARIES},
        "model": {"name": run.network.name} | run.network.identity | {"config": run.network.config},
        "settings": settings,
        "recording": {
            "name": events.path.name,
            "path": str(events.path.resolve()),
            "format": events.format,
            "sensor": {"height": events.sensor[0], "width": events.sensor[1]},
            "start_us": events.start_us,
            "stop_us": events.stop_us,
        },
        "camera": asdict(rectification.camera) | {"source": run.camera_source},
        "rotation": run.rotation.said,
        "rectified_image": asdict(rectification.image),
        "slices": course.slices,
        "interrupted": course.interrupted,
        "slices_per_s": round(course.slices_per_s, 2),
        "startup_s": round(course.startup_s, 3),
        "running_s": round(course.running_s, 3),
        "stages_ms": run.stopwatch.mean_ms(course.slices),
        "slices_without_events": run.finder.without_events,
        "objects_seen": run.finder.objects_seen,
        "objects_seen_for_100_ms": run.finder.objects_lasting,
        "invalid_pixels": rectification.invalid,
        "dropped_events": {
            "without_place_in_image": run.placed.dropped,
            "late": events.faults.late,
            "outlying": events.faults.outlying,
            "after_reset": events.faults.after_reset,
            "off_sensor": events.faults.outside,
        },
        "warnings": list(warnings),
    }
