"""Events around outlines: how many, of either polarity, lie at which distance before and behind them.

Every event is held against where the outline was at the event's own time, so that a fast outline is as sharp as a slow
one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from evimo.calibrating.contours import OutlinePoints, outline_points, straightened
from evimo.calibrating.fitting import NEAREST_M, Calibration
from evimo.calibrating.rigid import inverse, moved, nudged
from evimo.calibrating.world import Moment, World

F8 = NDArray[np.float64]

REACH_PX, EVERY_PX = 8.0, 0.5  # of a profile, to either side
SHORT_US = 2_000  # an outline moves by less than a px meanwhile
BLUR_PX = 0.6  # of events, that are whole pixels
MOST_POINTS = 200  # of the outlines of a moment
SPEED_US = 2_000.0  # to either side of a moment, from where to where an outline's speed is taken
STEPS = np.array((1e-3,) * 3 + (1e-3,) * 3 + (500.0,))  # m, rad, µs: a third of a px or so


@dataclass(frozen=True, slots=True)
class Profiles:
    """Events along the normals of N points of outlines, and how those would move.

    at:     (S,), px along the normal, from what is near to what is behind it.
    events: (N, 2, S) per px, OFF and ON.
    slopes: (N, 7), px along the normal for each of STEPS of a calibration: translation, rotation and clock.
    speed:  (N,), px/s along the normal. body: (N,), whose outline it is. moment: (N,), number of the moment.
    """

    at: F8
    events: F8
    slopes: F8
    speed: F8
    body: NDArray[np.int64]
    moment: NDArray[np.int64]

    def where(self, chosen: NDArray[np.bool_]) -> "Profiles":
        """Those of some points."""
        return Profiles(self.at, *(getattr(self, field.name)[chosen] for field in fields(self)[1:]))

    @property
    def share_on_outline(self) -> float:
        """The share of all events in the profiles that lie within a px of their outline."""
        events = self.events.sum(axis=(0, 1))
        return float(events[np.abs(self.at) <= 1].sum() / max(events.sum(), 1e-9))


@dataclass(frozen=True, slots=True)
class Placed:
    """Outlines of a moment as a calibration has them, fixed on their bodies: points (N, 3); normals as they are now."""

    moment: Moment
    points: F8
    body: NDArray[np.int64]
    outward: F8

    def px(self, calibration: Calibration, world: World, time_us: float) -> F8:
        """Where the points are in the image (N, 2) at a time of the camera's clock."""
        there = np.array([time_us - calibration.offset_us])
        cam_from_world = inverse(world.rig(there)[0][0] @ calibration.rig_from_cam)
        at = np.empty_like(self.points)
        for body in np.unique(self.body).tolist():
            mine = self.body == body
            at[mine] = moved(cam_from_world @ world.body_at(body, there[0])[0], self.points[mine])
        return calibration.camera.project(at[:, :2] / np.maximum(at[:, 2:], NEAREST_M))


def placed(now: Calibration, moment: Moment, world: World, *, margin: int) -> Placed | None:
    """The outlines of a moment, or None where mocap does not know where the rig is or nothing has an outline."""
    time_us = moment.time_us - now.offset_us
    world_from_rig, known = (each[0] for each in world.rig(np.array([time_us])))
    if not known:
        return None
    world_from_cam = world_from_rig @ now.rig_from_cam
    found = straightened(outline_points(world.render(time_us, world_from_cam), now.camera, margin=margin), now.camera)
    found = found.where(np.linspace(0, len(found.px) - 1, min(len(found.px), MOST_POINTS)).astype(np.int64))
    return _on_bodies(found, moment, world, (time_us, world_from_cam))


def _on_bodies(found: OutlinePoints, moment: Moment, world: World, seen_from: tuple[float, F8]) -> Placed | None:
    time_us, world_from_cam = seen_from
    points, kept = found.points.copy(), np.ones(len(found.px), np.bool_)
    for body in np.unique(found.body).tolist():
        world_from_body, tracked = world.body_at(body, time_us)
        mine = found.body == body
        kept[mine] = tracked
        points[mine] = moved(inverse(world_from_body) @ world_from_cam, points[mine])
    return Placed(moment, points[kept], found.body[kept], found.outward[kept]) if kept.any() else None


def profiles(now: Calibration, moments: Sequence[Moment], world: World, *, stretch: float) -> Profiles | None:
    """The profiles of all outlines of all moments, None without any; so many times as far and as coarse as usual."""
    at = stretch * np.arange(-REACH_PX, REACH_PX + EVERY_PX / 2, EVERY_PX)
    found: list[Profiles] = []
    for number, moment in enumerate(moments):
        outlines = placed(now, moment, world, margin=int(1.5 * REACH_PX))
        if outlines is not None:
            made = _profiles(now, outlines, world, at)
            found.append(replace(made, moment=np.full(len(made.speed), number, np.int64)))
    if not found:
        return None
    names = [field.name for field in fields(Profiles)[1:]]
    return Profiles(at, *(np.concatenate([getattr(each, name) for each in found]) for name in names))


def _profiles(now: Calibration, outlines: Placed, world: World, at: F8) -> Profiles:
    moment, normal = outlines.moment, outlines.outward
    count, size, blur_px = len(normal), now.camera.size, BLUR_PX * max(float(at[1] - at[0]) / EVERY_PX, 1)
    events = np.zeros((count, 2, len(at)))
    for time_us, images in moment.short_images(size, SHORT_US):
        px = outlines.px(now, world, time_us)[:, None] + at[:, None] * normal[:, None]
        for polarity, image in enumerate(images):
            blurred = cv2.GaussianBlur(image, (0, 0), blur_px)
            sampled = map_coordinates(blurred, px.reshape(-1, 2).T[::-1], order=1, mode="nearest")
            events[:, polarity] += sampled.reshape(count, -1)
    slopes = np.zeros((count, len(STEPS)))
    for number, way in enumerate(0.5 * np.diag(STEPS)):
        there, back = (outlines.px(stepped(now, sign * way), world, moment.time_us) for sign in (1, -1))
        slopes[:, number] = ((there - back) * normal).sum(axis=1)
    there, back = (outlines.px(now, world, moment.time_us + sign * SPEED_US) for sign in (1, -1))
    speed = ((there - back) * normal).sum(axis=1) / (2e-6 * SPEED_US)
    return Profiles(at, events, slopes, speed, outlines.body, np.zeros(count, np.int64))


def stepped(now: Calibration, step: F8) -> Calibration:
    """A calibration moved by (7,): m, rotation vector in rad, µs."""
    return replace(now, rig_from_cam=nudged(now.rig_from_cam, step[:6]), offset_us=now.offset_us + float(step[6]))
