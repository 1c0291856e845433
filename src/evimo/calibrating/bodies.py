"""Bodies as motion capture tracked them: where they were at any time, and where their markers sit on them."""

import numpy as np
from numpy.typing import NDArray

from evimo.calibrating.rigid import inverse
from evimo.calibrating.sightings import PoseAt
from evimo.captures.tracks import MarkerTracks, MocapTrack
from evimo.errors import BadInput
from evimo.geometry.trajectory import fit_trajectory

F8 = NDArray[np.float64]

FEWEST_SIGHTINGS = 5  # of a marker
SCATTER_M = 0.005  # a marker that wanders more on its body is taken for others now and then


def poses_of(track: MocapTrack) -> PoseAt:
    """Where a body was at any time, from a spline through its good samples."""
    good = track.tracked
    trajectory = fit_trajectory(track.times_us[good], track.world_from_body[good])

    def at(times_us: F8) -> tuple[F8, NDArray[np.bool_]]:
        motion = trajectory.at(np.rint(times_us).astype(np.int64))
        return motion.world_from_body, motion.valid

    return at


def markers_on_body(track: MocapTrack, markers: MarkerTracks) -> tuple[tuple[str, ...], F8]:
    """Names and places (K, 3), m, of markers in the axes of their body: the median over the times they were seen.

    Raises:
        BadInput: fewer than three were seen often enough in one place.
    """
    world_from_body, known = poses_of(track)(markers.times_us.astype(np.float64))
    body_from_world = inverse(world_from_body)
    names: list[str] = []
    places: list[F8] = []
    for number, name in enumerate(markers.names):
        used = known & markers.visible[:, number]
        if used.sum() < FEWEST_SIGHTINGS:
            continue
        turn, shift = body_from_world[used, :3, :3], body_from_world[used, :3, 3]
        on_body = np.einsum("mij,mj->mi", turn, markers.position[used, number]) + shift
        middle = np.median(on_body, axis=0)
        if np.median(np.linalg.norm(on_body - middle, axis=1)) < SCATTER_M:
            names.append(name)
            places.append(middle)
    if len(names) < 3:
        raise BadInput(
            f"mocap saw {len(names)} markers of {track.body} {FEWEST_SIGHTINGS} times or more in one place",
            fix="a longer part of the recording, or the markers of this body",
        )
    return tuple(names), np.array(places)
