"""Camera, its place on the rig, the target's place on its body and the clock, all at once, by least squares."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares
from scipy.spatial.transform import Rotation

from evimo.calibrating.rigid import inverse, moved, nudged
from evimo.calibrating.sightings import Mocap, Sightings
from evimo.errors import BadInput
from evimo.geometry.camera import Camera

F8 = NDArray[np.float64]

SOFT_PX = 1.0  # beyond, an error counts linearly
OUTLIER = 4.0  # times the robust deviation
LEAST_OUTLIER_PX = 2.0
ROUNDS = 4
FEWEST = 20  # points
STEPS = {"rig_from_cam": 1e-5, "body_from_target": 1e-5, "offset_us": 100.0, "intrinsics": 1e-2, "lens": 1e-4}
NEAREST_M = 0.02  # the camera looks from no nearer


@dataclass(frozen=True, slots=True, kw_only=True)
class Free:
    """What is fitted beside the camera's place on the rig."""

    intrinsics: bool = True
    lens: bool = True
    target: bool = True  # body_from_target
    clock: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """A camera on a rig, as it was fitted, and how well that is known.

    rig_from_cam, body_from_target: (4, 4).
    offset_us: a camera's time is mocap's and this.
    """

    camera: Camera
    rig_from_cam: F8
    body_from_target: F8
    offset_us: float


@dataclass(frozen=True, slots=True)
class Anchor:
    """Where the target was measured to be on its body (4, 4), and how well, m, at a distance of `lever_m` from there.

    It keeps few sightings from moving the target to where that suits the lens.
    """

    body_from_target: F8
    deviation_m: float
    lever_m: float

    def miss(self, body_from_target: F8) -> F8:
        """How far a place is from it (6,), in standard deviations."""
        step = inverse(self.body_from_target) @ body_from_target
        turn = Rotation.from_matrix(step[:3, :3]).as_rotvec()
        return np.concatenate((step[:3, 3], self.lever_m * turn)) / self.deviation_m


@dataclass(frozen=True, slots=True)
class Fit:
    """A calibration with what is left of the errors.

    errors_px:  (N, 2): of every sighting; NaN where mocap did not see both bodies.
    kept:       (N,) bool: sightings that took part to the end.
    deviations: by name, of what was fitted: standard deviations, from the errors that are left.
    """

    calibration: Calibration
    errors_px: F8
    kept: NDArray[np.bool_]
    deviations: dict[str, float]

    @property
    def median_px(self) -> float:
        """The median distance between where a point was found and where it should be, over all that are known."""
        return float(np.nanmedian(np.linalg.norm(self.errors_px, axis=1)))

    @property
    def rms_px(self) -> float:
        """Root of the mean squared distance, over those that took part."""
        return float(np.sqrt((self.errors_px[self.kept] ** 2).sum(axis=1).mean()))


def fit_calibration(
    start: Calibration, sightings: Sightings, mocap: Mocap, free: Free, *, anchor: Anchor | None = None
) -> Fit:
    """The calibration that brings the target's points closest to where they were found, mistaken ones left out.

    Args:
        start: near it.
        sightings: of the target.
        mocap: where the rig and the target were.
        free: what is fitted.
        anchor: what is known of the target's place, if anything.

    Raises:
        BadInput: too few sightings where mocap knows both bodies.
    """
    placed = _Placed(sightings.times_us, mocap)
    kept = np.asarray(np.isfinite(_errors(start, sightings, placed)).all(axis=1), np.bool_)
    now, solved, vary = start, None, _Variables(start, free)
    for _ in range(ROUNDS):
        if kept.sum() < FEWEST:
            raise BadInput(
                f"only {int(kept.sum())} points of the target are usable", fix=f"{FEWEST} and more, in several images"
            )
        vary, part = _Variables(now, free), sightings.where(kept)
        solved = _solved(vary, lambda made, part=part: _errors(made, part, placed), anchor)
        now = vary.made(solved.x)
        errors = _errors(now, sightings, placed)
        length = np.linalg.norm(errors, axis=1)
        gate = max(OUTLIER * 1.4826 * float(np.nanmedian(length[kept])) / 1.1774, LEAST_OUTLIER_PX)
        renewed = np.isfinite(length) & (length < gate)
        if (renewed == kept).all():
            break
        kept = renewed
    assert solved is not None
    errors = _errors(now, sightings, placed)
    return Fit(now, errors, kept, vary.deviations(solved))


def _solved(vary: "_Variables", errors: Callable[[Calibration], F8], anchor: Anchor | None) -> OptimizeResult:
    def miss(steps: F8) -> F8:
        made = vary.made(steps)
        told = anchor.miss(made.body_from_target) if anchor and vary.free.target else np.zeros(0)
        return np.concatenate((np.nan_to_num(errors(made), nan=0.0).ravel(), told))

    def slopes(steps: F8) -> F8:
        """Central differences: poses come from splines at whole µs, which small steps of the clock would not move."""
        ways = np.diag(vary.step)
        return np.stack([(miss(steps + way) - miss(steps - way)) / (2 * way.max()) for way in ways], axis=1)

    zero = np.zeros(len(vary.step))
    return least_squares(
        miss,
        zero,
        jac=cast("Any", slopes),
        x_scale=vary.step,
        loss="soft_l1",
        f_scale=SOFT_PX,
        xtol=1e-10,
        max_nfev=100,
    )


class _Placed:
    """The target's poses on the rig at the images' times; the last ones are kept, since few steps move the clock."""

    def __init__(self, times_us: F8, mocap: Mocap) -> None:
        self._times_us, self._mocap = times_us, mocap
        self._offset_us = 0.0
        self._last = mocap.rig_from_target(times_us)

    def at(self, offset_us: float) -> tuple[F8, NDArray[np.bool_]]:
        """As `Mocap.rig_from_target` says, under an offset."""
        if offset_us != self._offset_us:
            self._last, self._offset_us = self._mocap.rig_from_target(self._times_us - offset_us), offset_us
        return self._last


def _errors(made: Calibration, sightings: Sightings, placed: _Placed) -> F8:
    """Found minus expected, (N, 2) px; NaN where mocap knows too little, huge behind the camera."""
    rig_from_body, known = placed.at(made.offset_us)
    cam_from_target = inverse(made.rig_from_cam) @ rig_from_body @ made.body_from_target
    at = moved(cam_from_target[sightings.image], sightings.points[:, None])[:, 0]
    depth = np.maximum(at[:, 2:], NEAREST_M)
    return np.where(known[sightings.image, None], sightings.px - made.camera.project(at[:, :2] / depth), np.nan)


class _Variables:
    """The numbers that least squares moves, as steps from a calibration."""

    def __init__(self, start: Calibration, free: Free) -> None:
        self.start, self.free = start, free
        camera = start.camera
        lens = len(camera.distortion) if free.lens else 0
        self._counts = {
            "rig_from_cam": 6,
            "body_from_target": 6 if free.target else 0,
            "offset_us": 1 if free.clock else 0,
            "intrinsics": 4 if free.intrinsics else 0,
            "lens": lens,
        }
        self.step = np.concatenate([np.full(count, STEPS[name]) for name, count in self._counts.items()])

    def made(self, steps: F8) -> Calibration:
        """The calibration after these steps."""
        stops = np.cumsum(list(self._counts.values()))
        part = dict(zip(self._counts, np.split(steps, stops[:-1]), strict=True))
        now = self.start
        now = replace(now, rig_from_cam=nudged(now.rig_from_cam, part["rig_from_cam"]))
        if self.free.target:
            now = replace(now, body_from_target=nudged(now.body_from_target, part["body_from_target"]))
        if self.free.clock:
            now = replace(now, offset_us=now.offset_us + float(part["offset_us"][0]))
        return replace(now, camera=self._camera(part["intrinsics"], part["lens"]))

    def _camera(self, intrinsics: F8, lens: F8) -> Camera:
        camera = self.start.camera
        if self.free.intrinsics:
            fx, fy, cx, cy = np.array((camera.fx, camera.fy, camera.cx, camera.cy)) + intrinsics
            camera = replace(camera, fx=max(float(fx), 1.0), fy=max(float(fy), 1.0), cx=float(cx), cy=float(cy))
        if len(lens):
            camera = replace(camera, distortion=tuple(map(float, np.array(camera.distortion) + lens)))
        return camera

    def deviations(self, solved: OptimizeResult) -> dict[str, float]:
        """Standard deviations of position (m), rotation (rad), clock (µs) and intrinsics (px), the largest of each."""
        freedom = max(len(solved.fun) - len(solved.x), 1)
        information = solved.jac.T @ solved.jac
        spread = np.sqrt(np.maximum(np.diag(np.linalg.pinv(information)), 0) * (2 * solved.cost) / freedom)
        stops = np.cumsum(list(self._counts.values()))
        part = dict(zip(self._counts, np.split(spread, stops[:-1]), strict=True))
        found = {
            "position_m": float(part["rig_from_cam"][:3].max()),
            "rotation_rad": float(part["rig_from_cam"][3:].max()),
        }
        for name in ("offset_us", "intrinsics"):
            if len(part[name]):
                found[name if name == "offset_us" else "intrinsics_px"] = float(part[name].max())
        return found
