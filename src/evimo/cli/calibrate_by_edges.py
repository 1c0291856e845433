"""`evimo calibrate CAPTURE` without a target: its own recording, scans and motion capture refine its calibration."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from evimo.cli.progress import progress
from evimo.errors import BadInput

if TYPE_CHECKING:
    from evimo.calibrating.contours import Rendered
    from evimo.calibrating.edges import EdgeFit
    from evimo.calibrating.fitting import Calibration
    from evimo.calibrating.sightings import PoseAt
    from evimo.calibrating.world import Moment, World
    from evimo.captures.capture import Capture
    from evimo.formats.event_file import EventFile
    from evimo.geometry.camera import Camera

MOMENTS = 60  # of the recording, evenly
WINDOW_US = 12_000  # of events in each: an outline, as it is drawn once, changes little meanwhile
FEWEST_EVENTS = 50  # in a moment: with fewer nothing moves


def refine(source: Path, *, out: Path, search_ms: float) -> None:
    """Refine the calibration of a capture and save it."""
    from evimo.calibrating.edges import ROUNDS, refine_by_edges
    from evimo.calibrating.fitting import Calibration
    from evimo.captures.capture import open_capture

    capture = open_capture(source)
    start_pose = capture.camera.body_from_cam
    if start_pose is None:
        raise BadInput(
            f"{capture.path} has no `body_from_cam` to refine", fix="a rough one in `camera`, or --target FILE"
        )
    events = capture.recording.opened()
    camera = capture.lens(events)
    world = captured_world(capture, camera)
    moments = moments_of(events)
    start = Calibration(camera=camera, rig_from_cam=start_pose, body_from_target=np.eye(4), offset_us=0.0)
    with progress(len(ROUNDS), "rounds") as advance:
        fit = refine_by_edges(start, moments, world, search_us=1e3 * search_ms, advance=advance)
    _show(capture, start, fit, moments)
    _save(capture, fit, out)


def moments_of(events: "EventFile") -> list["Moment"]:
    """Short windows of a recording in which something moves."""
    from evimo.calibrating.event_images import windows
    from evimo.calibrating.world import Moment

    every_us = max((events.stop_us - events.start_us) // MOMENTS, WINDOW_US)
    found = windows(events, window_us=WINDOW_US, every_us=every_us)
    return [Moment(some) for some in found if len(some) >= FEWEST_EVENTS]


def captured_world(capture: "Capture", camera: "Camera") -> "World":
    """Motion capture and scans of a capture, ready to be drawn."""
    from evimo.calibrating.bodies import poses_of
    from evimo.calibrating.world import World

    tracks = capture.tracks()
    unplaced = [each.name for each in capture.objects if each.body_from_scan is None]
    if unplaced:
        raise BadInput(
            f"{capture.path}: `body_from_scan` of {', '.join(unplaced)} is not known", fix="evimo locate-markers"
        )
    if not capture.objects and capture.room is None:
        raise BadInput(f"{capture.path} has no scans, whose edges could be aligned", fix="`objects` or a `room`")
    bodies = {each.id: poses_of(tracks[each.body]) for each in capture.objects}
    return World(poses_of(tracks[capture.camera.body]), bodies, _Drawing(capture, camera, bodies))


class _Drawing:
    """Draws the scans of a capture from anywhere."""

    def __init__(self, capture: "Capture", camera: "Camera", bodies: dict[int, "PoseAt"]) -> None:
        from evimo.annotate.lens import lens_tables
        from evimo.annotate.surfaces import surfaces_of
        from evimo.annotate.tracked import FINE_OBJECT, FINE_ROOM, ROOM

        scans = [each.load() for each in capture.objects]
        self._from_scan = [(each.id, each.body_from_scan) for each in capture.objects]
        self._codes = [each.id for each in capture.objects]
        self._fine = [FINE_OBJECT] * len(scans)
        self._room = capture.room.world_from_scan if capture.room else None
        if capture.room:
            scans.append(capture.room.load())
            self._codes.append(ROOM)
            self._fine.append(FINE_ROOM)
        self._surfaces, self._lens, self._bodies = surfaces_of(scans), lens_tables(camera), bodies

    def __call__(self, time_us: float, world_from_cam: np.ndarray) -> "Rendered":
        """What is seen at a time of motion capture's clock, bodies that are lost then left out."""
        from evimo.annotate.tracked import ROOM
        from evimo.annotate.zbuffer import drawn
        from evimo.calibrating.contours import Rendered
        from evimo.calibrating.rigid import inverse

        cam_from_world, codes, poses = inverse(world_from_cam), list(self._codes), list[np.ndarray]()
        for number, (body, body_from_scan) in enumerate(self._from_scan):
            world_from_body, known = (each[0] for each in self._bodies[body](np.array([time_us])))
            codes[number] = codes[number] if known else 0
            poses.append(cam_from_world @ world_from_body @ body_from_scan)
        if self._room is not None:
            poses.append(cam_from_world @ self._room)
        depth, seen = drawn(self._surfaces, self._lens, np.array(poses)[:, :3], codes, np.array(self._fine))
        return Rendered(depth, np.where(seen == ROOM, 0, seen).astype(np.int64), seen > 0)


def _show(capture: "Capture", start: "Calibration", fit: "EdgeFit", moments: Sequence["Moment"]) -> None:
    from evimo.calibrating.rigid import angle_between

    made, (one, other) = fit.calibration, fit.halves
    moved = 1e3 * np.linalg.norm(made.rig_from_cam[:3, 3] - start.rig_from_cam[:3, 3])
    turned = np.degrees(float(angle_between(made.rig_from_cam, start.rig_from_cam)))
    apart = 1e3 * np.linalg.norm(one.rig_from_cam[:3, 3] - other.rig_from_cam[:3, 3]) / 2
    askew = np.degrees(float(angle_between(one.rig_from_cam, other.rig_from_cam))) / 2
    print(
        f"{capture.path}: of the events within 8 px of outlines, {100 * fit.before:.1f} % lay on them before, "
        f"{100 * fit.after:.1f} % do now"
    )
    print(
        f"  camera moved by {moved:.2f} mm and {turned:.3f} degrees, clock by {made.offset_us:+.0f} us, "
        "in which is how late the pixels are (up to 3 ms)"
    )
    print(
        f"  from half of the {len(moments)} moments each: +-{apart:.2f} mm, +-{askew:.3f} degrees, "
        f"+-{abs(one.offset_us - other.offset_us) / 2:.0f} us"
    )
    shifts = fit.shifts
    print(
        f"  events beside outlines: {shifts.behind:+.2f} px behind in motion, {shifts.dark:+.2f} px towards the dark, "
        f"{shifts.room:+.2f} (room) and {shifts.body:+.2f} (objects) px outwards; ON {shifts.on_lag_us:+.0f} us late"
    )


def _save(capture: "Capture", fit: "EdgeFit", out: Path) -> None:
    from evimo.calibrating.settings import save_settings
    from evimo.captures.entries import pose_words

    settings = {
        "camera": {"body_from_cam": pose_words(fit.calibration.rig_from_cam)},
        "mocap": {"offset_us": round(capture.offset_us + fit.calibration.offset_us)},
    }
    save_settings(settings, out, capture.path)
