"""`evimo calibrate`: where a camera sits on its tracked rig, its lens and its clock."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from evimo.errors import BadInput, check_installed

if TYPE_CHECKING:
    from evimo.calibrating.fitting import Fit
    from evimo.calibrating.sightings import Sightings
    from evimo.calibrating.sources import Source

FILE = "calibration.yaml"


def calibrate(
    source: Path,
    *,
    target: Path | None = None,
    camera: str | None = None,
    calibration: Path | None = None,
    lens: Literal["radtan", "fisheye"] = "radtan",
    fit_intrinsics: bool = False,
    search: float = 200.0,
    window: float = 10.0,
    every: float = 40.0,
    out: Path | None = None,
) -> None:
    """Find where a camera sits on its rig, its lens and its clock.

    With a target that the camera and motion capture both see, from nothing. Without one, a capture that is some
    pixels wrong is refined: outlines of its scans, drawn where mocap has them, are aligned with its events.
    The clock then has in it how late the pixels are, up to 3 ms.

    Args:
        source: a capture; or a folder of images and poses collected together, as EVIMO2's.
        target: file of a wand of flickering lights or of a board of squares; EVIMO2's table of a wand is one too.
        camera: folder of images, in a collected set of several cameras.
        calibration: file of the intrinsics of a collected set, which are kept; without it they are fitted.
        lens: the model to fit, where there are no intrinsics.
        fit_intrinsics: fit them even where they are given.
        search: how far the camera's clock may be from that of motion capture, in ms.
        window: of events that make an image of the target, in ms; a few periods of its flicker.
        every: from one such window to the next, in ms.
        out: the file that a capture reads, calibration.yaml in the capture by default, beside it a picture of errors.
    """
    check_installed("calibrating", "scipy", "trimesh", extra="simulate")
    from evimo.calibrating.collected import is_collected
    from evimo.calibrating.sources import captured_source, collected_source

    if not 0 <= search <= 10_000 or not 0 < window <= every:
        raise BadInput("impossible times", fix="--search from 0 to 10000, --window above 0 and at most --every, ms")
    if out is not None and out.is_dir():
        raise BadInput(f"--out is the folder {str(out)!r}", fix="a file, as in --out calibration.yaml")
    if target is None:
        from evimo.cli.calibrate_by_edges import refine

        refine(source, out=out or _beside(source), search_ms=search)
        return
    if is_collected(source):
        made = collected_source(source, target, camera=camera, calibration=calibration, lens=lens)
    else:
        made = captured_source(source, target, lens=lens, window_us=round(1e3 * window), every_us=round(1e3 * every))
    made = replace(made, free=replace(made.free, intrinsics=made.free.intrinsics or fit_intrinsics))
    made = replace(made, free=replace(made.free, lens=made.free.intrinsics))
    fit, sightings = made.fit(search_us=1e3 * search)
    _show(made, fit, sightings)
    _save(made, fit, sightings, out)


def _beside(source: Path) -> Path:
    return (source if source.is_dir() else source.parent) / FILE


def _show(made: "Source", fit: "Fit", sightings: "Sightings") -> None:
    """What was found, how well it fits, and how well it is known."""
    from evimo.calibrating.rigid import angle_between

    found, known = fit.calibration, fit.deviations
    length = np.linalg.norm(fit.errors_px, axis=1)
    images = len(np.unique(sightings.image))
    print(f"{made.name}: the target in {images} of {len(sightings.times_us)} images, {len(sightings)} points")
    print(
        f"  error: median {fit.median_px:.3f} px, 95 % below {np.nanpercentile(length, 95):.3f} px; "
        f"{int((~fit.kept).sum())} points left out"
    )
    x, y, z = 1e3 * found.rig_from_cam[:3, 3]
    print(
        f"  camera on its body: {x:.2f} {y:.2f} {z:.2f} mm, "
        f"known to {1e3 * known['position_m']:.2f} mm and {np.degrees(known['rotation_rad']):.3f} degrees (1 sigma)"
    )
    lens = found.camera
    numbers = " ".join(f"{value:.2f}" for value in (lens.fx, lens.fy, lens.cx, lens.cy))
    bent = " ".join(f"{value:.4f}" for value in lens.distortion)
    how = f"known to {known['intrinsics_px']:.2f} px" if "intrinsics_px" in known else "as given"
    print(f"  fx fy cx cy: {numbers}, {lens.lens} {bent}; {how}")
    if "offset_us" in known:
        print(f"  clock: events = motion capture {found.offset_us:+.0f} us, known to {known['offset_us']:.0f} us")
    if made.before is not None:
        moved = 1e3 * np.linalg.norm(found.rig_from_cam[:3, 3] - made.before[:3, 3])
        turned = np.degrees(float(angle_between(found.rig_from_cam, made.before)))
        print(f"  from the calibration before: {moved:.2f} mm, {turned:.3f} degrees")


def _save(made: "Source", fit: "Fit", sightings: "Sightings", out: Path | None) -> None:
    from evimo.calibrating.settings import camera_words, save_settings
    from evimo.captures.entries import pose_words
    from evimo.viewing.picture import save_picture
    from evimo.viewing.residuals import draw_residuals

    if out is None and made.capture is None:
        return
    out = out or _beside(made.folder)
    found = fit.calibration
    camera: dict[str, object] = {"body_from_cam": pose_words(found.rig_from_cam)}
    if made.free.intrinsics:
        camera["intrinsics"] = camera_words(found.camera)
    settings: dict[str, object] = {"camera": camera}
    if made.free.clock:
        settings["mocap"] = {"offset_us": round(made.offset_us + found.offset_us)}
    picture = out.with_suffix(".png")
    save_picture(draw_residuals(sightings.px, fit.errors_px, fit.kept, size=found.camera.size), picture)
    save_settings(settings, out, made.capture)
    print(f"saved {picture}")
