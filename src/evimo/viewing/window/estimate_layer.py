"""What a run estimated, slice by slice, in metres where truth tells the scale and in mean depths elsewhere."""

import numpy as np
from numpy.typing import NDArray

from evimo.geometry.camera import Camera
from evimo.recordings.prediction import Prediction
from evimo.recordings.truth import Truth
from evimo.viewing.colours import DEPTH_RANGE
from evimo.viewing.window.clouds import Lifter
from evimo.viewing.window.entities import DEPTH, ESTIMATE, IDS, POINTS, VELOCITIES
from evimo.viewing.window.motions import (
    Arrow,
    Depths,
    ObjectCurves,
    arrows_of,
    ids_image,
    log_curves,
    log_depth,
    log_id_colours,
    points_of,
    start_curves,
    start_depth,
)
from evimo.viewing.window.store import Store


class EstimateLayer:
    """Draws the estimates of one camera.

    Args:
        camera: of the sensor.
        bounds: nearest and farthest depth that colours tell apart, m; None where there is no truth to scale by.
    """

    def __init__(self, camera: Camera, *, bounds: tuple[float, float] | None) -> None:
        self._metric, self._bounds = bounds is not None, bounds or DEPTH_RANGE
        self._unit = "m/s" if self._metric else "mean depths/s"
        self._camera, self._lifter = camera, Lifter(camera)
        self._curves = ObjectCurves(ESTIMATE, unit=self._unit, faded=self._metric)

    def start(self, store: Store) -> None:
        """Log what holds at all times: the colours, and the names of curves."""
        log_id_colours(store, IDS)
        start_depth(store, DEPTH)
        start_curves(store, ESTIMATE, unit=self._unit, faded=self._metric)

    def draw(self, store: Store, estimate: Prediction, *, t_us: int, truth: Truth | None) -> None:
        """Log one slice; it is empty where nothing is known, or where truth is needed for the scale and missing."""
        depth, ids = estimate.rel_depth, estimate.ids
        scale = self._scale(estimate, truth)
        if depth is None or ids is None or scale is None:
            for entity in (IDS, DEPTH, POINTS, VELOCITIES):
                store.log(entity, store.rr.Clear(recursive=True), t_us=t_us)
            log_curves(store, ESTIMATE, np.full(6, np.nan), t_us=t_us)
            self._curves.log(store, [], t_us=t_us)
            return
        known = np.ones(ids.shape, np.bool_) if estimate.valid is None else estimate.valid
        metres = depth.astype(np.float32) * np.float32(scale)
        store.log(IDS, ids_image(store, ids), t_us=t_us)
        log_depth(store, DEPTH, Depths(metres, known, self._bounds), t_us=t_us)
        cloud = self._lifter.cloud(metres, known)
        store.log(POINTS, points_of(store, cloud, ids, bounds=self._bounds, faded=self._metric), t_us=t_us)
        arrows = self._arrows(estimate, ids, metres, scale)
        store.log(VELOCITIES, arrows_of(store, arrows, unit=self._unit, faded=self._metric), t_us=t_us)
        if estimate.ego is not None:
            log_curves(store, ESTIMATE, _scaled(estimate.ego, scale), t_us=t_us)
        self._curves.log(store, arrows, t_us=t_us)

    def _scale(self, estimate: Prediction, truth: Truth | None) -> float | None:
        """Metres in one mean depth: the median ratio of true and estimated depths; 1 without truth at all."""
        if not self._metric:
            return 1.0
        if truth is None or estimate.rel_depth is None:
            return None
        both = truth.valid & (estimate.rel_depth > 0)
        both &= True if estimate.valid is None else estimate.valid
        return float(np.median(truth.depth[both] / estimate.rel_depth[both])) if both.any() else None

    def _arrows(
        self, estimate: Prediction, ids: NDArray[np.int32], metres: NDArray[np.float32], scale: float
    ) -> list[Arrow]:
        """The velocity of each object that some pixel shows, drawn from the middle of its mask."""
        if estimate.velocity is None:
            return []
        arrows: list[Arrow] = []
        for key in np.unique(ids[ids > 0]).tolist():
            rows, columns = np.nonzero(ids == key)
            centre = np.array([[columns.mean(), rows.mean()]])
            xy, _ = self._camera.normalised(centre)
            z = float(np.median(metres[rows, columns]))
            velocity = estimate.velocity[rows[0], columns[0]] * scale
            if np.isfinite(velocity).all():
                arrows.append(Arrow(key, np.array([*xy[0] * z, z]), velocity))
        return arrows


def _scaled(ego: NDArray[np.float64], scale: float) -> NDArray[np.float64]:
    """A twist in metres."""
    return np.concatenate((ego[:3] * scale, ego[3:]))
