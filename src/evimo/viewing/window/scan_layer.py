"""The scans of a capture, each on its body, and the markers that motion capture saw."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from evimo.events.slices import SLICE_US, Slice
from evimo.viewing.colours import id_colour
from evimo.viewing.window.entities import MARKERS, OBJECTS, SCANNED_ROOM
from evimo.viewing.window.sources import Markers, Shape
from evimo.viewing.window.store import Store

MOST_POINTS = {True: 300_000, False: 40_000}
"""Of the room, and of an object: of more, every so many are shown."""
ROOM_COLOUR = (120, 124, 132)
MARKER_COLOUR = (245, 166, 35)


def log_shapes(store: Store, shapes: Sequence[Shape]) -> None:
    """Log scans; those of objects move with their poses."""
    for shape in shapes:
        room = not shape.object_id
        entity = SCANNED_ROOM if room else f"{OBJECTS}/{shape.object_id}/scan"
        matrix = shape.body_from_scan
        store.log_always(entity, store.rr.Transform3D(translation=matrix[:3, 3], mat3x3=matrix[:3, :3]))
        colour = ROOM_COLOUR if room else id_colour(shape.object_id)
        if len(shape.triangles):
            mesh = store.rr.Mesh3D(
                vertex_positions=shape.points,
                vertex_normals=_normals(shape.points, shape.triangles),
                triangle_indices=shape.triangles,
                albedo_factor=colour,
            )
            store.log_always(entity, mesh)
        else:
            points = shape.points[:: -(-len(shape.points) // MOST_POINTS[room])]
            store.log_always(entity, store.rr.Points3D(points, colors=[colour], radii=store.rr.Radius.ui_points(1.2)))


def _normals(points: NDArray[np.floating], triangles: NDArray[np.integer]) -> NDArray[np.float32]:
    """The directions (N, 3) that the triangles around each point face: without them all of a room has one colour."""
    one, two, three = (points[triangles[:, corner]] for corner in range(3))
    facing = np.cross(two - one, three - one)
    around = [np.bincount(triangles.ravel(), np.repeat(facing[:, axis], 3), len(points)) for axis in range(3)]
    normals = np.stack(around, axis=1)
    return (normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)).astype(np.float32)


def log_markers(store: Store, markers: Sequence[Markers], part: Slice) -> None:
    """Log the markers that were visible nearest to the middle of a slice."""
    for one in markers:
        if not len(one.times_us):
            continue
        away_us = np.abs(one.times_us - part.centre_us)
        nearest = int(away_us.argmin())
        seen = one.visible[nearest] & (away_us[nearest] <= SLICE_US // 2)
        dots = store.rr.Points3D(one.position[nearest][seen], colors=[MARKER_COLOUR], radii=[0.006])
        store.log(f"{MARKERS}/{one.body}", dots, t_us=part.centre_us)
