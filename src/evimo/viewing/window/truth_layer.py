"""What really happened, slice by slice: masks, depth, points, velocities, and the room as it comes into view."""

import numpy as np
from numpy.typing import NDArray

from evimo.geometry.camera import Camera
from evimo.recordings.pose_track import PoseTrack
from evimo.recordings.truth import Truth
from evimo.viewing.window.clouds import Lifter, moved
from evimo.viewing.window.entities import ROOM, TRUE_DEPTH, TRUE_IDS, TRUE_POINTS, TRUE_VELOCITIES, TRUTH
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

ROOM_POINTS = 250  # of each slice; they stay, and become the room
ROOM_COLOUR = (84, 88, 96)


class TruthLayer:
    """Draws truth of one camera.

    Args:
        camera: of the sensor.
        track: where it was; None where nobody knows, and then no room comes about.
        bounds: nearest and farthest depth that colours tell apart, m.
    """

    def __init__(self, camera: Camera, track: PoseTrack | None, *, bounds: tuple[float, float]) -> None:
        self._track, self._bounds = track, bounds
        self._lifter, self._thin = Lifter(camera), Lifter(camera, most=ROOM_POINTS)
        self._curves = ObjectCurves(TRUTH, unit="m/s")

    def start(self, store: Store) -> None:
        """Log what holds at all times: the colours, and the names of curves."""
        log_id_colours(store, TRUE_IDS)
        start_depth(store, TRUE_DEPTH)
        start_curves(store, TRUTH, unit="m/s")

    def draw(self, store: Store, truth: Truth) -> None:
        """Log one instant."""
        t_us, ids, known = truth.t_us, truth.ids, truth.valid
        store.log(TRUE_IDS, ids_image(store, ids), t_us=t_us)
        log_depth(store, TRUE_DEPTH, Depths(truth.depth, known, self._bounds), t_us=t_us)
        cloud = self._lifter.cloud(truth.depth, known)
        store.log(TRUE_POINTS, points_of(store, cloud, ids, bounds=self._bounds), t_us=t_us)
        arrows = [Arrow(key, one.position, one.velocity) for key, one in truth.objects.items() if (ids == key).any()]
        store.log(TRUE_VELOCITIES, arrows_of(store, arrows, unit="m/s"), t_us=t_us)
        log_curves(store, TRUTH, truth.ego, t_us=t_us)
        self._curves.log(store, arrows, t_us=t_us)
        self._grow_room(store, truth)

    def _grow_room(self, store: Store, truth: Truth) -> None:
        """Add some points of the static world."""
        world_from_cam = None if self._track is None else nearest_pose(self._track, truth.t_us)
        if world_from_cam is None:
            return
        cloud = self._thin.cloud(truth.depth, truth.valid & (truth.ids == 0))
        points = moved(cloud.points, world_from_cam)
        radius = store.rr.Radius.ui_points(1.0)
        store.log(ROOM, store.rr.Points3D(points, colors=[ROOM_COLOUR], radii=radius), t_us=truth.t_us)


def nearest_pose(track: PoseTrack, t_us: int) -> NDArray[np.float64] | None:
    """The camera's pose (4, 4) at the sample nearest to a time; None where it is not known."""
    after = int(np.searchsorted(track.times_us, t_us))
    around = [k for k in (after - 1, after) if 0 <= k < len(track.times_us)]
    if not around:
        return None
    nearest = min(around, key=lambda k: abs(int(track.times_us[k]) - t_us))
    pose = track.world_from_cam[nearest]
    return pose if np.isfinite(pose).all() else None
