"""Fill a Rerun file with all that there is to show, slice after slice."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from evimo.events.slices import Slice
from evimo.recordings.pose_track import PoseTrack
from evimo.recordings.truth import Truth
from evimo.viewing.truth_panels import depth_bounds
from evimo.viewing.window.arrangement import Content, arrangement, eye_behind
from evimo.viewing.window.estimate_layer import EstimateLayer
from evimo.viewing.window.event_layer import EventLayer
from evimo.viewing.window.pose_layer import log_camera, log_camera_world, log_poses
from evimo.viewing.window.scan_layer import log_markers, log_shapes
from evimo.viewing.window.store import Store
from evimo.viewing.window.subject import Subject
from evimo.viewing.window.truth_layer import TruthLayer


class Layers(NamedTuple):
    """What is drawn; None where there is nothing of it."""

    events: EventLayer | None
    truth: TruthLayer | None
    estimates: EstimateLayer | None


def fill(
    store: Store, subject: Subject, slices: Iterable[Slice], *, shown_us: tuple[int, int], speed: float
) -> Iterator[Slice]:
    """Log a subject, and yield each slice after it was logged.

    Args:
        store: to fill.
        subject: what there is.
        slices: that are shown, in order; without events where there are none.
        shown_us: from when until when; ways are drawn as far.
        speed: at which the window plays, 1 being real time.
    """
    layers = _started(store, subject, shown_us=shown_us, speed=speed)
    for part in slices:
        if layers.events is not None:
            layers.events.draw(store, part)
        truth = None if subject.truth is None else subject.truth.at(part)
        if layers.truth is not None and truth is not None:
            layers.truth.draw(store, truth)
        if layers.estimates is not None:
            _draw_estimate(store, layers.estimates, subject, part, truth)
        log_markers(store, subject.markers, part)
        store.finished_slice()
        yield part


def _started(store: Store, subject: Subject, *, shown_us: tuple[int, int], speed: float) -> Layers:
    """The layers, and all logged that holds at all times."""
    source, camera = subject.truth, subject.camera
    estimates = subject.estimates is not None and camera is not None
    track = None if source is None else source.poses(*shown_us)
    content = Content(
        events=subject.events is not None,
        truth=source is not None,
        estimates=estimates,
        speed=speed,
        eye=None if track is None else eye_behind(track),
    )
    store.arrange(arrangement(content))
    if camera is not None:
        log_camera(store, camera)
    if track is not None:
        log_poses(store, track)
    elif camera is not None:
        log_camera_world(store)
    log_shapes(store, subject.shapes)
    layers = _layers(subject, track)
    for layer in layers:
        if layer is not None:
            layer.start(store)
    return layers


def _layers(subject: Subject, track: PoseTrack | None) -> Layers:
    source, camera = subject.truth, subject.camera
    bounds = None if source is None else depth_bounds(source.some())
    truth = None if source is None or bounds is None else TruthLayer(source.camera, track, bounds=bounds)
    estimates = None if subject.estimates is None or camera is None else EstimateLayer(camera, bounds=bounds)
    return Layers(None if subject.events is None else EventLayer(subject.sensor), truth, estimates)


def _draw_estimate(store: Store, layer: EstimateLayer, subject: Subject, part: Slice, truth: Truth | None) -> None:
    """Draw the estimate whose time lies in a slice, if there is one."""
    maps = subject.estimates
    if maps is None:
        return
    k = int(np.searchsorted(maps.times_us, part.start_us))
    if k < len(maps.times_us) and maps.times_us[k] < part.stop_us:
        layer.draw(store, maps.at(k), t_us=int(maps.times_us[k]), truth=truth)
