"""A calibration refined on any recording: outlines of scans, drawn where mocap has them, are aligned with events.

What people move sliders for. The calibration is moved until as many events as possible lie on the outlines.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, spline_filter
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from evimo.calibrating.contours import Rendered, outline_points
from evimo.calibrating.fitting import NEAREST_M, Calibration
from evimo.calibrating.rigid import inverse, moved, nudged
from evimo.calibrating.sightings import PoseAt
from evimo.errors import BadInput

F8 = NDArray[np.float64]
Render = Callable[[float, F8], Rendered]
"""Draw everything at a time of mocap's clock, µs, from a camera at world_from_cam (4, 4)."""

BLURS_PX = (6.0, 3.0, 1.5, 1.5)  # of events, in rounds: from how far outlines are drawn in, and then how exactly
SEARCH_US = 5_000.0  # from one clock to the next that is tried: a few px
AROUND = 4.0  # times as far, events around an outline are counted, with which those on it are compared
MOST_POINTS = 300  # of the outlines of a moment
FEWEST_POINTS = 1_000  # together
STEPS = np.array((1e-3,) * 3 + (1e-3,) * 3 + (500.0,))  # m, rad, µs: a third of a px or so
USUAL = np.array((0.003,) * 3 + (0.02,) * 3 + (50_000.0,))  # how wrong a calibration is, m, rad, µs
PULL = 5e-3  # of that knowledge, in density. Texture draws outlines inwards, as a step back of the camera would


@dataclass(frozen=True, slots=True)
class Moment:
    """Events of a short while: their mean time, µs, camera's clock, and how many each pixel had (H, W)."""

    time_us: float
    counts: F8


@dataclass(frozen=True, slots=True)
class World:
    """What mocap and scans know: the rig, the bodies by id (0, the room, stands still), and how to draw them."""

    rig: PoseAt
    bodies: Mapping[int, PoseAt]
    render: Render


@dataclass(frozen=True, slots=True)
class EdgeFit:
    """A refined calibration.

    before, after: share of an outline's surroundings' events that lie on it, 0 to 1, mean over the outlines.
    halves:        what half of the moments says, and what the other half says: their difference tells how well
                   the calibration is known.
    """

    calibration: Calibration
    before: float
    after: float
    halves: tuple[Calibration, Calibration]


def refine_by_edges(
    start: Calibration,
    moments: Sequence[Moment],
    world: World,
    *,
    search_us: float = 0.0,
    advance: Callable[[], None] = lambda: None,
) -> EdgeFit:
    """The camera's place and clock under which outlines meet the events of many moments best.

    Args:
        start: within some pixels of the truth; the camera itself and the target are kept.
        moments: in which something moves.
        world: mocap and scans.
        search_us: how far the clock may be off, to either side, before alignment begins.
        advance: called after each of the len(BLURS_PX) rounds.

    Raises:
        BadInput: too few outlines are in view while mocap knows where everything is.
    """
    now, first = _clock_searched(start, moments, world, search_us), 0.0
    outlines: list[_Outline] = []
    for number, blur_px in enumerate(BLURS_PX):
        outlines = _drawn(now, moments, world, blur_px)
        if number == len(BLURS_PX) - 1:
            first = _mean(_scores(start, outlines, world))
        now = _aligned(now, start, outlines, world)
        advance()
    halves = tuple(_aligned(now, start, outlines[half::2], world) for half in (0, 1))
    return EdgeFit(now, first, _mean(_scores(now, outlines, world)), (halves[0], halves[1]))


def _clock_searched(start: Calibration, moments: Sequence[Moment], world: World, search_us: float) -> Calibration:
    """The calibration with the clock under which most events are on the outlines as they are drawn now."""
    if not search_us:
        return start
    outlines = _drawn(start, moments, world, BLURS_PX[0])
    offsets = start.offset_us + np.arange(-search_us, search_us + SEARCH_US / 2, SEARCH_US)
    tried = [replace(start, offset_us=float(offset_us)) for offset_us in offsets]
    return tried[int(np.argmax([_mean(_scores(each, outlines, world)) for each in tried]))]


@dataclass(frozen=True, slots=True)
class _Outline:
    """Outlines of a moment.

    points: (N, 3), on the bodies' axes. body: (N,). px: (N, 2), where they were drawn.
    slope:  (N, 2), 1/px: of the density that events would have there if they lay on the outlines exactly.
    spline: the cubic spline of `event_density` (H, W).
    """

    time_us: float
    points: F8
    body: NDArray[np.int64]
    px: F8
    slope: F8
    spline: F8


def _drawn(now: Calibration, moments: Sequence[Moment], world: World, blur_px: float) -> list[_Outline]:
    """The outlines of all moments at which mocap knows the rig and some body, as a calibration has them."""
    found: list[_Outline] = []
    for moment in moments:
        time_us = moment.time_us - now.offset_us
        world_from_rig, known = (each[0] for each in world.rig(np.array([time_us])))
        if not known:
            continue
        outline = _outline(now, moment, (time_us, world_from_rig @ now.rig_from_cam), world, blur_px)
        if len(outline.points):
            found.append(outline)
    count = sum(len(each.points) for each in found)
    if count < FEWEST_POINTS:
        raise BadInput(
            f"{count} points of outlines in {len(found)} of {len(moments)} moments",
            fix="a longer recording in which scanned objects, or a scanned room, are in view and move",
        )
    return found


def _outline(now: Calibration, moment: Moment, seen_from: tuple[float, F8], world: World, blur_px: float) -> _Outline:
    """The outlines of one moment, from a camera at a time of mocap's."""
    time_us, world_from_cam = seen_from
    margin = int(np.ceil(2 * blur_px))
    points, px, body = outline_points(world.render(time_us, world_from_cam), now.camera, margin=margin)
    expected = spline_filter(event_density(_drawn_counts(px, moment.counts.shape), blur_px))
    some = np.linspace(0, len(px) - 1, min(len(px), MOST_POINTS)).astype(np.int64)
    points, px, body = points[some], px[some], body[some]
    kept = np.ones(len(px), np.bool_)
    for number in np.unique(body).tolist():
        world_from_body, tracked = _at(world, number, time_us)
        mine = body == number
        kept[mine] = tracked
        points[mine] = moved(inverse(world_from_body) @ world_from_cam, points[mine])
    ways = 0.5 * np.eye(2)
    slope = np.stack([_sampled(expected, px + way) - _sampled(expected, px - way) for way in ways], axis=1)
    spline = spline_filter(event_density(moment.counts, blur_px))
    return _Outline(moment.time_us, points[kept], body[kept], px[kept], slope[kept], spline)


def _drawn_counts(px: F8, shape: tuple[int, ...]) -> F8:
    """Events as they would be if all lay on an outline (N, 2), whose points lie halfway between two pixels."""
    counts = np.zeros(shape)
    for each in (np.floor(px), np.ceil(px)):
        x, y = each.astype(np.int64).T
        np.add.at(counts, (y, x), 0.5)
    return counts


def _at(world: World, body: int, time_us: float) -> tuple[F8, bool]:
    if body not in world.bodies:
        return np.eye(4), body == 0
    poses, known = world.bodies[body](np.array([time_us]))
    return poses[0], bool(known[0])


def event_density(counts: F8, blur_px: float) -> NDArray[np.float32]:
    """How much denser events lie at a pixel than around it, 0 to 1 (H, W): 1 on a lonely line, ½ in an even crowd."""
    events = np.sqrt(counts.astype(np.float32))  # pixels that fire without end count less
    on = cv2.GaussianBlur(events, (0, 0), blur_px)
    around = cv2.GaussianBlur(events, (0, 0), AROUND * blur_px)
    return np.asarray(on / (on + around + 0.25 * float(events.mean()) + 1e-6), np.float32)


def _aligned(now: Calibration, start: Calibration, outlines: Sequence[_Outline], world: World) -> Calibration:
    """The calibration that brings the outlines, fixed on their bodies, to where events are dense.

    Blurred events are densest a little inside a bent outline, and nearer to its neighbours, by what `slope` tells: so
    much density may be had by moving there, and is not counted.
    """

    def loss(steps: F8) -> float:
        made = _moved(now, STEPS * steps)
        density, drift = _scores(made, outlines, world)
        return float((drift - density).mean() + PULL * ((_apart(made, start) / USUAL) ** 2).sum())

    def slope(steps: F8) -> F8:
        ways = 0.5 * np.eye(len(steps))
        return np.array([loss(steps + way) - loss(steps - way) for way in ways])

    solved = minimize(loss, np.zeros(len(STEPS)), jac=slope, method="BFGS", options={"gtol": 1e-5, "maxiter": 60})
    return _moved(now, STEPS * solved.x)


def _apart(made: Calibration, start: Calibration) -> F8:
    """Translation in m, rotation vector in rad and offset in µs from one to the other (7,)."""
    step = inverse(start.rig_from_cam) @ made.rig_from_cam
    turn = Rotation.from_matrix(step[:3, :3]).as_rotvec()
    return np.concatenate((step[:3, 3], turn, [made.offset_us - start.offset_us]))


def _moved(now: Calibration, steps: F8) -> Calibration:
    return replace(now, rig_from_cam=nudged(now.rig_from_cam, steps[:6]), offset_us=now.offset_us + float(steps[6]))


def _scores(made: Calibration, outlines: Sequence[_Outline], world: World) -> tuple[F8, F8]:
    """The density of events at all points of the outlines, and how much of it is due to their having moved."""
    cam_from_rig = inverse(made.rig_from_cam)
    times_us = np.array([each.time_us for each in outlines]) - made.offset_us
    world_from_rig, known = world.rig(times_us)
    bodies = {body: at(times_us) for body, at in world.bodies.items()}
    density: list[F8] = []
    drift: list[F8] = []
    for number, outline in enumerate(outlines):
        at = np.zeros_like(outline.points)
        usable = np.zeros(len(at), np.bool_)
        for body in np.unique(outline.body).tolist():
            there, tracked = (each[number] for each in bodies[body]) if body in bodies else (np.eye(4), True)
            mine = outline.body == body
            at[mine] = moved(cam_from_rig @ inverse(world_from_rig[number]) @ there, outline.points[mine])
            usable[mine] = tracked and known[number]
        px = made.camera.project(at[:, :2] / np.maximum(at[:, 2:], NEAREST_M))
        density.append(np.where(usable, _sampled(outline.spline, px), 0.5))
        drift.append(np.where(usable, ((px - outline.px) * outline.slope).sum(axis=1), 0))
    return np.concatenate(density), np.concatenate(drift)


def _sampled(spline: F8, px: F8) -> F8:
    """Values at pixels (N, 2) of an image given by its cubic spline; outside, those at the border.

    Cubic: outlines begin between whole pixels, where a linear interpolation has a corner that would hold them.
    """
    return map_coordinates(spline, px.T[::-1], order=3, prefilter=False, mode="nearest")


def _mean(scores: tuple[F8, F8]) -> float:
    return float(scores[0].mean())
