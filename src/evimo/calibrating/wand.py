"""A camera calibrated with a wand of lights: found in its images, labelled, fitted, and found again by prediction."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from evimo.calibrating.clock import search_offset
from evimo.calibrating.fitting import NEAREST_M, Anchor, Calibration, Fit, Free, fit_calibration
from evimo.calibrating.lights import WandPattern
from evimo.calibrating.resection import resect, taken_apart
from evimo.calibrating.rigid import inverse, moved
from evimo.calibrating.sightings import Mocap, Sightings
from evimo.errors import BadInput
from evimo.geometry.camera import Camera

F8 = NDArray[np.float64]

GATE_PX = 8.0  # a spot this close to where a light should be is it
FEWEST_IMAGES = 6
FEWEST_LIGHTS = 3  # of an image, found by prediction
GUIDED = 2  # times that lights are found by prediction and fitted again


@dataclass(frozen=True, slots=True, kw_only=True)
class Wand:
    """Lights (K, 3) in m, where their axes lie on the body that mocap tracks (4, 4), and how well that is known, m."""

    lights: F8
    body_from_lights: F8
    deviation_m: float

    def anchor(self) -> Anchor:
        """The same, for a fit."""
        spread = self.lights - self.lights.mean(axis=0)
        return Anchor(self.body_from_lights, self.deviation_m, float(np.sqrt((spread**2).sum(axis=1).mean())))


def calibrate_with_wand(
    spots: Sequence[F8], times_us: F8, wand: Wand, mocap: Mocap, *, start: Camera, free: Free, search_us: float = 0.0
) -> tuple[Fit, Sightings]:
    """The camera's place on the rig from images of a wand; and which spots were taken for which lights.

    Args:
        spots: bright spots (N, 2) of each image, px.
        times_us: of the images (F,), camera's clock.
        wand: its lights.
        mocap: where the rig and the wand were.
        start: size and lens; its intrinsics are kept if `free` does not fit them, and found anew if it does.
        free: what is fitted beside the place on the rig.
        search_us: how far the camera's clock may be from mocap's, to either side; then least squares take over.

    Raises:
        BadInput: the wand was found in too few images, or nothing fits.
    """
    first = _labelled(spots, times_us, WandPattern(wand.lights))
    if len(np.unique(first.image)) < FEWEST_IMAGES:
        raise BadInput(
            f"the wand was recognised in {len(np.unique(first.image))} of {len(spots)} images",
            fix=f"{FEWEST_IMAGES} and more; fewer other lights, or the right lights in the target's file",
        )
    offset_us = search_offset(first, wand.body_from_lights, mocap, start, search_us) if free.clock else 0.0
    fit = _first_fit(first, wand, mocap, start=start, free=free, offset_us=offset_us)
    found = first
    for _ in range(GUIDED):
        found = _predicted(spots, times_us, wand, mocap, fit.calibration)
        fit = fit_calibration(fit.calibration, found, mocap, free, anchor=wand.anchor())
    return fit, found


def _labelled(spots: Sequence[F8], times_us: F8, pattern: WandPattern) -> Sightings:
    """The lights of images that can be read as the wand, in the way that fits best."""
    rows: list[tuple[int, int, F8]] = []
    for image, those in enumerate(spots):
        for labels, _ in pattern.labels(those)[:1]:
            rows += [(image, light, those[spot]) for light, spot in labels.items()]
    return _sightings(rows, times_us, pattern.points)


def _sightings(rows: list[tuple[int, int, F8]], times_us: F8, lights: F8) -> Sightings:
    image, light = (np.array([row[at] for row in rows], np.int64) for at in (0, 1))
    px = np.array([row[2] for row in rows], np.float64).reshape(-1, 2)
    return Sightings(times_us, image, lights[light], px)


def _first_fit(first: Sightings, wand: Wand, mocap: Mocap, *, start: Camera, free: Free, offset_us: float) -> Fit:
    """A fit without any guess of where the camera is."""
    rig_from_body, known = mocap.rig_from_target(first.times_us - offset_us)
    first = first.where(known[first.image])
    on_rig = first.on_rig(rig_from_body @ wand.body_from_lights)
    px = first.px if free.intrinsics else start.normalised(first.px)[0] * start.fx
    projection, kept = resect(on_rig, px, first.image, np.random.default_rng(0))
    matrix, cam_from_rig = taken_apart(projection)
    camera = start
    if free.intrinsics:
        lens = start.distortion or (0.0,) * 4
        camera = Camera(matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *start.size, lens, start.lens)
    begin = Calibration(
        camera=camera,
        rig_from_cam=inverse(cam_from_rig),
        body_from_target=wand.body_from_lights,
        offset_us=offset_us,
    )
    stiff = Free(intrinsics=free.intrinsics, lens=free.lens, target=False, clock=free.clock)
    rough = fit_calibration(begin, first.where(kept), mocap, stiff)
    return fit_calibration(rough.calibration, first.where(kept), mocap, free, anchor=wand.anchor())


def _predicted(spots: Sequence[F8], times_us: F8, wand: Wand, mocap: Mocap, now: Calibration) -> Sightings:
    """The spots that lie where a calibration expects lights, those of wands that are only partly in view too."""
    rig_from_body, known = mocap.rig_from_target(times_us - now.offset_us)
    cam_from_lights = inverse(now.rig_from_cam) @ rig_from_body @ now.body_from_target
    rows: list[tuple[int, int, F8]] = []
    for image, those in enumerate(spots):
        at = moved(cam_from_lights[image], wand.lights)
        if not known[image] or not len(those) or at[:, 2].min() < NEAREST_M:
            continue
        away = np.linalg.norm(now.camera.project(at[:, :2] / at[:, 2:])[:, None] - those, axis=-1)
        lights, chosen = linear_sum_assignment(np.minimum(away, 2 * GATE_PX))
        near = away[lights, chosen] < GATE_PX
        if near.sum() >= FEWEST_LIGHTS:
            rows += [(image, int(light), those[spot]) for light, spot in zip(lights[near], chosen[near], strict=True)]
    return _sightings(rows, times_us, wand.lights)
