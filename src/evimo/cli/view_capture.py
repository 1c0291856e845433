"""A capture in the window of `evimo view`: its scans, and the truth that `evimo annotate` would make."""

from collections.abc import Iterable, Iterator
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from evimo.errors import check_installed

if TYPE_CHECKING:
    from evimo.annotate.annotation import Annotation
    from evimo.events.slices import Slice
    from evimo.geometry.camera import Camera
    from evimo.recordings.pose_track import PoseTrack
    from evimo.recordings.truth import Truth
    from evimo.viewing.window.sources import Shape
    from evimo.viewing.window.subject import Subject

CAPTURE, SUFFIXES = "capture.yaml", (".yaml", ".yml")


def is_capture(path: Path) -> bool:
    """Whether this is the folder of a capture, or the YAML file in it."""
    return (path / CAPTURE).is_file() if path.is_dir() else path.suffix.lower() in SUFFIXES


def capture_subject(path: Path) -> "Subject":
    """What there is to show of a capture.

    Raises:
        MissingExtra: the extra that annotating needs is not installed.
        EvimoError: it is not calibrated yet, or a file is missing or damaged.
    """
    from evimo.cli.annotate import ANNOTATING

    check_installed("showing a capture", *ANNOTATING, extra="simulate")
    from evimo.annotate.annotation import Annotation, instants_of
    from evimo.captures.capture import open_capture
    from evimo.viewing.window.sources import Markers
    from evimo.viewing.window.subject import Subject

    capture = open_capture(path)
    annotation = Annotation(capture, instants_of("40"), threads=1)
    tracks = capture.marker_tracks().values()
    return Subject(
        name=annotation.name or "capture",
        sensor=annotation.events.sensor,
        camera=annotation.camera,
        events=annotation.events,
        truth=CapturedTruth(annotation),
        shapes=tuple(_shapes(annotation)),
        markers=tuple(Markers(one.body, one.times_us, one.position, one.visible) for one in tracks),
    )


class CapturedTruth:
    """The truth that follows from poses and scans, drawn as it is asked for."""

    def __init__(self, annotation: "Annotation") -> None:
        self._annotation = annotation
        self._coming: Iterator[Truth] | None = None

    @property
    def camera(self) -> "Camera":
        """Of the sensor."""
        return self._annotation.camera

    @cached_property
    def _instants(self) -> "np.ndarray[tuple[int], np.dtype[np.int64]]":
        """The middles of all slices at which the camera was tracked."""
        return np.concatenate([self._annotation.times(part) for part in self._annotation.frames])

    def poses(self, start_us: int, stop_us: int) -> "PoseTrack":
        """Where the camera and the objects were."""
        from evimo.viewing.window.sources import POSES_US

        return self._annotation.scene.poses(np.arange(start_us, stop_us, POSES_US, dtype=np.int64))

    def some(self) -> "Iterable[Truth]":
        """The first instant, the middle and the last."""
        instants = self._instants
        return self._annotation.truths(instants[[0, len(instants) // 2, -1]]) if len(instants) else []

    def at(self, part: "Slice") -> "Truth | None":
        """The truth in the middle of a slice; None where the camera was lost."""
        first = int(np.searchsorted(self._instants, part.centre_us))
        if first == len(self._instants) or self._instants[first] != part.centre_us:
            return None
        if self._coming is None:
            self._coming = self._annotation.truths(self._instants[first:])
        return next(self._coming)


def _shapes(annotation: "Annotation") -> "Iterator[Shape]":
    """The scans of the objects, in the axes of their middles, and of the room."""
    from evimo.viewing.window.sources import Shape

    capture, middles = annotation.capture, annotation.scene.scan_from_middle
    for each, scan_from_middle in zip(capture.objects, middles, strict=True):
        scan = each.load()
        yield Shape(each.id, scan.points, scan.triangles, np.linalg.inv(scan_from_middle))
    if capture.room is not None:
        scan = capture.room.load()
        yield Shape(0, scan.points, scan.triangles, capture.room.world_from_scan)
