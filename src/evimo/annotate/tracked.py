"""Where the camera and the objects of a capture were at any time, and how fast, from motion capture at 200 Hz."""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.annotate.paths import STRETCH_US, BodyPath
from evimo.annotate.surfaces import Surfaces, surfaces_of
from evimo.captures.capture import Capture
from evimo.errors import BadInput
from evimo.geometry.rotations import inverse_poses
from evimo.geometry.trajectory import Motion
from evimo.recordings.paths import moving_of
from evimo.recordings.pose_track import PoseTrack
from evimo.recordings.truth import ObjectTruth

F8 = NDArray[np.float64]
I8 = NDArray[np.int64]
Bools = NDArray[np.bool_]

VOID_US = 1_000_000  # an object's last place is void for so long after it is lost; then nobody knows where it is
ROOM, VOID = 254, 255  # codes in the image of what is seen, beside the ids of objects
FINE_OBJECT, FINE_ROOM = 0.7, 2.0  # px, radius of discs: an object's outline is its mask


class Body:
    """A rigid body's path, and a frame fixed on it whose motion is asked for."""

    def __init__(self, path: BodyPath, body_from_frame: F8) -> None:
        """`body_from_frame`: (4, 4)."""
        self.path, self._body_from_frame = path, body_from_frame
        self._moved = lru_cache(maxsize=2)(self._moves)

    def at(self, times_us: I8) -> Motion:
        """The frame's poses and twists, in its own axes."""
        motion = self.path.at(times_us)
        rotation, offset = self._body_from_frame[:3, :3], self._body_from_frame[:3, 3]
        velocity, spin = motion.twist[:, :3], motion.twist[:, 3:]
        twist = np.concatenate(((velocity + np.cross(spin, offset)) @ rotation, spin @ rotation), axis=1)
        return Motion(motion.world_from_body @ self._body_from_frame, twist, motion.valid)

    def moving(self, times_us: I8) -> Bools:
        """When the frame moves (M,), as it does in datasets: told from what it did up to then, for 20 s at least."""
        starts = times_us // STRETCH_US * STRETCH_US
        moving = np.zeros(len(times_us), np.bool_)
        for start_us in np.unique(starts).tolist():
            mine = starts == start_us
            steps_us, moves = self._moved(start_us)
            if len(steps_us):
                place = np.searchsorted(steps_us, times_us[mine], side="right") - 1
                moving[mine] = moves[np.maximum(place, 0)]
        return moving

    def _moves(self, start_us: int) -> tuple[I8, Bools]:
        """The samples of a stretch and of the one before, and at which of them the frame moves."""
        steps_us = self.path.samples_us(start_us - STRETCH_US, start_us + STRETCH_US)
        return steps_us, moving_of(self.at(steps_us)) if len(steps_us) else np.zeros(0, np.bool_)


class Placed(NamedTuple):
    """Everything at F times in camera axes; K objects, B bodies that are drawn: the objects, then maybe the room.

    valid:      (F,) whether the camera was tracked; else the others mean nothing.
    track:      poses of the camera and of the objects' middles.
    ego:        (F, 6) the camera's twist.
    objects:    for each time, the motion of each object that was tracked, by id.
    cam_from_scan: (F, B, 3, 4). codes: (F, B) to draw them with.
    """

    valid: Bools
    track: PoseTrack
    ego: F8
    objects: list[dict[int, ObjectTruth]]
    cam_from_scan: F8
    codes: NDArray[np.uint8]


@dataclass(frozen=True)
class TrackedScene:
    """The camera, the objects and the room of a capture, ready to be drawn at any time.

    ids: (K,) of the objects. scan_from_middle: (K, 4, 4), the middles of the objects, about which they turn.
    fine: (B,) px, how coarse each may be drawn. world_from_room: (4, 4); None without one.
    """

    camera: Body
    objects: tuple[Body, ...]
    ids: NDArray[np.uint8]
    scan_from_middle: F8
    surfaces: Surfaces
    fine: F8
    world_from_room: F8 | None

    def at(self, times_us: I8) -> Placed:
        """Everything at times (F,)."""
        camera = self.camera.at(times_us)
        cam_from_world = inverse_poses(camera.world_from_body)
        moved = [body.at(times_us) for body in self.objects]
        middles = np.full((len(times_us), len(moved), 4, 4), np.nan)
        scans, codes = [], []
        objects: list[dict[int, ObjectTruth]] = [{} for _ in times_us]
        for k, motion in enumerate(moved):
            pose = cam_from_world @ motion.world_from_body
            middles[motion.valid, k] = pose[motion.valid]
            scans.append(pose @ np.linalg.inv(self.scan_from_middle[k]))
            codes.append(np.where(motion.valid, self.ids[k], self._lost(k, times_us)))
            velocity = np.einsum("fij,fj->fi", pose[:, :3, :3], motion.twist[:, :3])
            spin = np.einsum("fij,fj->fi", pose[:, :3, :3], motion.twist[:, 3:])
            moves = self.objects[k].moving(times_us)
            for f in np.flatnonzero(motion.valid).tolist():
                objects[f][int(self.ids[k])] = ObjectTruth(pose[f, :3, 3], velocity[f], spin[f], bool(moves[f]))
        if self.world_from_room is not None:
            scans.append(cam_from_world @ self.world_from_room)
            codes.append(np.full(len(times_us), ROOM))
        track = PoseTrack(times_us, camera.world_from_body, self.ids, middles)
        bodies = np.stack(scans, axis=1)[:, :, :3]
        return Placed(camera.valid, track, camera.twist, objects, bodies, np.stack(codes, axis=1).astype(np.uint8))

    def poses(self, times_us: I8) -> PoseTrack:
        """Poses of the camera and the objects at those of the times at which the camera was tracked."""
        placed = self.at(times_us)
        track, kept = placed.track, placed.valid
        return PoseTrack(times_us[kept], track.world_from_cam[kept], track.object_ids, track.cam_from_object[kept])

    def _lost(self, k: int, times_us: I8) -> NDArray[np.int64]:
        """The code of a lost object: void where it was seen last, for a while."""
        since_us = times_us - self.objects[k].path.last_seen_us(times_us)
        return np.where((since_us > 0) & (since_us < VOID_US), VOID, 0)


def tracked_scene(capture: Capture) -> TrackedScene:
    """Load the poses and the scans of a capture.

    Raises:
        BadInput: a pose that the calibration finds is not known yet, or nothing can be drawn.
        NotFound, BadFile: a file is missing or damaged.
    """
    _check_calibrated(capture)
    tracks = capture.tracks()
    assert capture.camera.body_from_cam is not None
    paths = {body: BodyPath(tracks.pop(body)) for body in list(tracks)}  # an hour of samples is not kept twice
    camera = Body(paths[capture.camera.body], capture.camera.body_from_cam)
    scans = [each.load() for each in capture.objects]
    bodies, middles = list[Body](), list[F8]()
    for each, scan in zip(capture.objects, scans, strict=True):
        assert each.body_from_scan is not None
        middle = np.eye(4)
        middle[:3, 3] = (scan.points.min(axis=0) + scan.points.max(axis=0)) / 2
        middles.append(middle)
        bodies.append(Body(paths[each.body], each.body_from_scan @ middle))
    room = capture.room
    fine = [FINE_OBJECT] * len(bodies) + [FINE_ROOM] * (room is not None)
    return TrackedScene(
        camera,
        tuple(bodies),
        np.array([each.id for each in capture.objects], np.uint8),
        np.array(middles).reshape(-1, 4, 4),
        surfaces_of([*scans, room.load()] if room else scans),
        np.array(fine),
        room.world_from_scan if room else None,
    )


def _check_calibrated(capture: Capture) -> None:
    if capture.camera.body_from_cam is None:
        raise BadInput(f"{capture.path}: `camera` lacks `body_from_cam`", fix="evimo calibrate finds it")
    for each in capture.objects:
        if each.body_from_scan is None:
            name = f"objects.{each.name}"
            raise BadInput(f"{capture.path}: `{name}` lacks `body_from_scan`", fix="evimo locate-markers finds it")
    if not capture.objects and capture.room is None:
        raise BadInput(f"{capture.path} has neither objects nor a room", fix="`objects` with their scans")
