"""Where the camera and the objects are: the frustum, axes, and their ways through the world."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from evimo.geometry.camera import Camera
from evimo.recordings.pose_track import PoseTrack
from evimo.viewing.colours import RGB, id_colour
from evimo.viewing.window.entities import CAMERA, IMAGE, OBJECTS, TRAJECTORIES, WORLD
from evimo.viewing.window.store import Store

F8 = NDArray[np.float64]

FRUSTUM_M = 0.3  # from the camera to the picture in its cone of vision
AXES_M = 0.1
MOST_CORNERS = 20_000  # of a way; of longer ones every so many poses are drawn
CAMERA_COLOUR: RGB = (255, 255, 255)


def log_camera(store: Store, camera: Camera, *, frustum: float = FRUSTUM_M) -> None:
    """Log the cone of vision of a camera; the lens is left out, so that the edge of a wide picture is not exact."""
    matrix = [
        [camera.fx, 0, camera.cx + 0.5],
        [0, camera.fy, camera.cy + 0.5],
        [0, 0, 1],
    ]  # its pixels begin at corners
    pinhole = store.rr.Pinhole(
        image_from_camera=matrix,
        resolution=[camera.width, camera.height],
        camera_xyz=store.rr.ViewCoordinates.RDF,
        image_plane_distance=frustum,
        color=CAMERA_COLOUR,
    )
    store.log_always(IMAGE, pinhole)


def log_camera_world(store: Store) -> None:
    """Log a world that moves with the camera, where nobody knows its poses: x right, y down, z forward."""
    store.log_always(WORLD, store.rr.ViewCoordinates.RDF)
    store.log_always(CAMERA, store.rr.Transform3D(translation=[0.0, 0.0, 0.0]))


def log_poses(store: Store, track: PoseTrack) -> None:
    """Log all poses of a recording, and the ways of the camera and of the objects as lines; the world's z is up.

    A pose that is not known is NaN; the line is broken there.
    """
    store.log_always(WORLD, store.rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    _log_body(store, CAMERA, track.times_us, track.world_from_cam)
    _log_way(store, "camera", track.world_from_cam, colour=CAMERA_COLOUR)
    for column, key in enumerate(track.object_ids.tolist()):
        world_from_object = track.world_from_cam @ track.cam_from_object[:, column]
        entity = f"{OBJECTS}/{key}"
        _log_body(store, entity, track.times_us, world_from_object)
        store.log_always(entity, store.rr.TransformAxes3D(AXES_M))
        _log_way(store, f"object_{key}", world_from_object, colour=id_colour(key))


def _log_body(store: Store, entity: str, times_us: NDArray[np.int64], world_from_body: F8) -> None:
    known = np.isfinite(world_from_body).all(axis=(1, 2))
    poses = world_from_body[known]
    columns = store.rr.Transform3D.columns(translation=poses[:, :3, 3], mat3x3=poses[:, :3, :3].reshape(-1, 9))
    store.log_columns(entity, columns, times_us=times_us[known])


def _log_way(store: Store, name: str, world_from_body: F8, *, colour: RGB) -> None:
    places = world_from_body[:: -(-len(world_from_body) // MOST_CORNERS) or 1, :3, 3]
    strips = [strip for strip in _unbroken(places) if len(strip) > 1]
    lines = store.rr.LineStrips3D(strips, colors=[colour], radii=store.rr.Radius.ui_points(1.2))
    store.log_always(f"{TRAJECTORIES}/{name}", lines)


def _unbroken(places: F8) -> Iterator[F8]:
    """The pieces of a way (M, 3) between places that are not known."""
    known = np.isfinite(places).all(axis=1)
    cuts = np.flatnonzero(np.diff(known)) + 1
    for piece, is_known in zip(np.split(places, cuts), np.split(known, cuts), strict=True):
        if is_known.all() and len(piece):
            yield piece
