"""A calibration refined on any recording: outlines of scans, drawn where mocap has them, are aligned with events.

What people move sliders for. Outlines are drawn, events around them are counted along their normals, and the
calibration is moved so that the outlines lie where the events are dense; then they are drawn anew.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from scipy.spatial.transform import Rotation

from evimo.calibrating.fitting import Calibration
from evimo.calibrating.outline_fit import MOST_SHIFT_PX, Round, Shifts, fit_outlines
from evimo.calibrating.profiles import Profiles, placed, profiles, stepped
from evimo.calibrating.rigid import inverse
from evimo.calibrating.world import Moment, World
from evimo.errors import BadInput

F8 = NDArray[np.float64]

ROUNDS = (
    Round(4.0, 2.0, place=False, shifts=False),
    Round(2.5, 1.0, place=False, shifts=False),
    Round(1.5, 1.0, place=False, shifts=True),
    Round(1.0, 1.0, place=True, shifts=True),
    Round(0.7, 1.0, place=True, shifts=True),
)
FEWEST_POINTS = 1_000  # of outlines, together
SEARCH_US = 5_000.0  # from one clock to the next that is tried: a few px
SEARCH_BLUR_PX = 6.0  # of events: from how far they are felt
SEARCH_MOMENTS = 20
AROUND = 4.0  # times as far, events around an outline are counted, with which those on it are compared


@dataclass(frozen=True, slots=True)
class EdgeFit:
    """A refined calibration.

    before, after: share of the events within 8 px of outlines that lie within 1 px, of the first and of this one.
    shifts:        where events lie beside outlines.
    halves:        what half of the moments says, and what the other half says: their difference tells how well
                   the calibration is known.
    """

    calibration: Calibration
    before: float
    after: float
    shifts: Shifts
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
        advance: called after each of the len(ROUNDS) rounds.

    Raises:
        BadInput: too few outlines are in view while mocap knows where everything is, or texture hides them.
    """
    before = _profiled(start, moments, world, 1.0).share_on_outline
    now = _clock_searched(start, moments, world, search_us)
    for how in ROUNDS[:-1]:
        step, _ = fit_outlines(_profiled(now, moments, world, how.stretch), how, _apart(now, start))
        now = stepped(now, step)
        advance()
    found, last, apart = _profiled(now, moments, world, ROUNDS[-1].stretch), ROUNDS[-1], _apart(now, start)
    step, shifts = fit_outlines(found, last, apart)
    if shifts.at_limit:
        raise BadInput(
            f"events lie {MOST_SHIFT_PX} px or more beside the outlines: texture hides them, or the start is far off",
            fix="a target, a better first calibration, or a longer recording of plainer things",
        )
    halves = [stepped(now, fit_outlines(found.where(found.moment % 2 == half), last, apart)[0]) for half in (0, 1)]
    now = stepped(now, step)
    after = _profiled(now, moments, world, 1.0).share_on_outline
    advance()
    return EdgeFit(now, before, after, shifts, (halves[0], halves[1]))


def _profiled(now: Calibration, moments: Sequence[Moment], world: World, stretch: float) -> Profiles:
    found = profiles(now, moments, world, stretch=stretch)
    count = 0 if found is None else len(found.speed)
    if found is None or count < FEWEST_POINTS:
        raise BadInput(
            f"{count} points of outlines in {len(moments)} moments",
            fix="a longer recording in which scanned objects, or a scanned room, are in view and move",
        )
    return found


def _apart(made: Calibration, start: Calibration) -> F8:
    """Translation in m, rotation vector in rad and offset in µs from one to the other (7,)."""
    step = inverse(start.rig_from_cam) @ made.rig_from_cam
    turn = Rotation.from_matrix(step[:3, :3]).as_rotvec()
    return np.concatenate((step[:3, 3], turn, [made.offset_us - start.offset_us]))


def _clock_searched(start: Calibration, moments: Sequence[Moment], world: World, search_us: float) -> Calibration:
    """The calibration with the clock under which most events are on the outlines as they are drawn now."""
    if not search_us:
        return start
    some = moments[:: max(1, len(moments) // SEARCH_MOMENTS)]
    found = [each for each in (placed(start, moment, world, margin=int(2 * SEARCH_BLUR_PX)) for moment in some) if each]
    images = [event_density(each.moment.counts(start.camera.size), SEARCH_BLUR_PX) for each in found]
    offsets = start.offset_us + np.arange(-search_us, search_us + SEARCH_US / 2, SEARCH_US)

    def score(offset_us: float) -> float:
        made = replace(start, offset_us=offset_us)
        px = [each.px(made, world, each.moment.time_us) for each in found]
        each = [
            map_coordinates(image, at.T[::-1], order=1, mode="nearest") for image, at in zip(images, px, strict=True)
        ]
        return float(np.concatenate(each).mean())

    return replace(start, offset_us=float(offsets[int(np.argmax([score(float(each)) for each in offsets]))]))


def event_density(counts: F8, blur_px: float) -> NDArray[np.float32]:
    """How much denser events lie at a pixel than around it, 0 to 1 (H, W): 1 on a lonely line, ½ in an even crowd."""
    events = np.sqrt(counts.astype(np.float32))  # pixels that fire without end count less
    on = cv2.GaussianBlur(events, (0, 0), blur_px)
    around = cv2.GaussianBlur(events, (0, 0), AROUND * blur_px)
    return np.asarray(on / (on + around + 0.25 * float(events.mean()) + 1e-6), np.float32)
