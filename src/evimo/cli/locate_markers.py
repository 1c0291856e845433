"""`evimo locate-markers`: the balls of motion capture in scans, and where a scan lies on its tracked body."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from evimo.errors import BadInput, EvimoError, check_installed
from evimo.writing import save_files

if TYPE_CHECKING:
    from evimo.calibrating.markers import Marker
    from evimo.captures.capture import Capture, CapturedObject
    from evimo.captures.scans import Scan
    from evimo.captures.tracks import MarkerTracks, MocapTrack

RADII = "2-9"
FILE = "markers.yaml"
SAME_M = 0.003  # from a marker that was found: a listed one so near is the same


def locate_markers(
    *scans: Path,
    unit: Literal["m", "cm", "mm"] = "m",
    radius: str = RADII,
    tolerance: float = 3.0,
    out: Path | None = None,
) -> None:
    """Find the markers of motion capture in scans of objects.

    Of a scan: the centre of every ball in it, found in the whole scan, without anybody cutting it. Of a capture: the
    markers of all its objects, recognised among those that motion capture saw, in any order, and from them where each
    scan lies on its body; the capture reads the file.

    Args:
        scans: scans (PLY, OBJ, STL, OFF, GLB), folders of objects, or captures.
        unit: of the scans; a capture says it itself.
        radius: smallest and largest of a marker, in mm.
        tolerance: how far a scan's marker may lie from the one of motion capture, in mm.
        out: folder for a list of markers of each scan; of a capture, the file, markers.yaml in it by default.
    """
    check_installed("locating markers", "scipy", "trimesh", extra="simulate")
    if not scans:
        raise BadInput("no scan given", fix="evimo locate-markers SCAN")
    low, high = _radii_m(radius)
    captures = [scan for scan in scans if _is_capture(scan)]
    if captures and len(scans) > 1:
        raise BadInput("a capture stands beside other scans", fix="one capture, or scans alone")
    if captures:
        _of_capture(captures[0], (low, high), tolerance / 1e3, out)
        return
    lists: dict[str, str] = {}
    for path in scans:
        scan, found = _located(path, unit, (low, high))
        _show(path, scan, found)
        lists[f"{path.stem if path.is_file() else path.resolve().name}_markers.txt"] = _listed(found, unit)
    if out is not None:
        if len(lists) < len(scans):
            raise BadInput("two scans have the same name", fix="one at a time, each with its own --out")
        save_files(out, lists)
        print(f"saved in {out}: {', '.join(lists)}")


def _is_capture(path: Path) -> bool:
    from evimo.captures.capture import CAPTURE

    return path.suffix in (".yaml", ".yml") or (path / CAPTURE).is_file()


def _radii_m(text: str) -> tuple[float, float]:
    try:
        low, high = (float(word) / 1e3 for word in text.split("-"))
    except ValueError:
        low = high = 0.0
    if not 0 < low < high:
        raise BadInput(f"--radius is {text!r}", fix=f"smallest and largest in mm, as {RADII}")
    return low, high


def _located(path: Path, unit: str, radii: tuple[float, float]) -> tuple["Scan", tuple["Marker", ...]]:
    from evimo.calibrating.markers import locate_markers as located
    from evimo.captures.scans import load_scan

    scan = load_scan(path, unit=unit)
    return scan, located(scan.points, radii=radii)


def _show(path: Path, scan: "Scan", found: Sequence["Marker"]) -> None:
    """A line for each marker, with how far it lies from the one that the scan's own list has."""
    print(f"{path}: {len(scan.points):,} points, {len(found)} markers")
    for number, marker in enumerate(found, 1):
        x, y, z = 1e3 * marker.centre
        line = f"  {number}  {x:9.3f} {y:9.3f} {z:9.3f} mm  radius {1e3 * marker.radius:.3f} mm"
        line += f"  {marker.points} points, rms {1e3 * marker.rms:.3f} mm, {marker.coverage:.0%} of the ball"
        if len(scan.markers):
            away = np.linalg.norm(scan.markers - marker.centre, axis=1)
            line += f"  {1e3 * away.min():.3f} mm from listed marker {int(away.argmin()) + 1}"
        print(line)


def _listed(found: Sequence["Marker"], unit: str) -> str:
    """A text of markers as captures read it, in the scan's own unit."""
    from evimo.captures.scans import UNITS

    rows = (marker.centre / UNITS[unit] for marker in found)
    return "".join(f"{number} {x:.9g} {y:.9g} {z:.9g}\n" for number, (x, y, z) in enumerate(rows, 1))


def _of_capture(path: Path, radii: tuple[float, float], tolerance_m: float, out: Path | None) -> None:
    """Locate, recognise and place the scans of all objects of a capture."""
    from evimo.calibrating.settings import save_settings
    from evimo.captures.capture import open_capture
    from evimo.captures.entries import pose_words

    capture = open_capture(path)
    tracks, markers = _mocap_of(capture)
    placed: dict[str, object] = {}
    for each in capture.objects:
        try:
            placed[each.name] = {"body_from_scan": pose_words(_placed(each, tracks, markers, radii, tolerance_m))}
        except EvimoError as error:
            raise type(error)(f"{each.name}: {error.problem}", fix=error.fix) from error
    if not placed:
        raise BadInput(f"{capture.path} has no objects", fix="`objects` in it")
    save_settings({"objects": placed}, out or capture.path.parent / FILE, capture.path)


def _mocap_of(capture: "Capture") -> tuple[dict[str, "MocapTrack"], dict[str, "MarkerTracks"]]:
    markers = capture.marker_tracks()
    if not markers:
        raise BadInput(f"{capture.path} names no markers of motion capture", fix="`mocap: {markers: [FILE]}`")
    return capture.tracks(), markers


def _placed(
    each: "CapturedObject",
    tracks: dict[str, "MocapTrack"],
    markers: dict[str, "MarkerTracks"],
    radii: tuple[float, float],
    tolerance_m: float,
) -> np.ndarray:
    """The pose of a scan on its body."""
    from evimo.calibrating.bodies import markers_on_body
    from evimo.calibrating.markers import locate_markers as located
    from evimo.calibrating.matching import match_markers

    if each.body not in markers:
        raise BadInput(f"no markers of body {each.body}", fix=f"markers of {', '.join(markers)} are there")
    scan = each.load()
    centres = _with_listed(located(scan.points, radii=radii), scan)
    names, on_body = markers_on_body(tracks[each.body], markers[each.body])
    match = match_markers(centres, on_body, tolerance=tolerance_m)
    pairs = ", ".join(f"{scanned + 1} is {names[tracked]}" for scanned, tracked in match.pairs)
    print(f"{each.name}: {len(centres)} markers in the scan, {len(names)} of motion capture: {pairs}")
    print(f"  rms {1e3 * match.rms:.3f} mm, largest {1e3 * match.errors.max():.3f} mm")
    return match.body_from_scan


def _with_listed(found: Sequence["Marker"], scan: "Scan") -> np.ndarray:
    """Centres (K, 3) of the markers found in a scan, and of those that its list has elsewhere.

    People list markers that are not in the scan, as they were put on later, or were too small or shiny for the scanner.
    """
    centres = np.array([marker.centre for marker in found]).reshape(-1, 3)
    away = np.linalg.norm(scan.markers[:, None] - centres, axis=2).min(axis=1, initial=np.inf)
    return np.concatenate((centres, scan.markers[away > SAME_M]))
