"""`evimo align-room`: one model of a room from fragments of it and where motion capture saw the scanner."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from evimo.cli.progress import progress
from evimo.errors import BadFile, BadInput, check_installed
from evimo.writing import new_file

if TYPE_CHECKING:
    from evimo.calibrating.fragments import AlignedRoom
    from evimo.captures.entries import Entry


def align_room(fragments: Path, *, out: Path, spacing: float = 10.0, farthest: float = 4.0) -> None:
    """Put fragments of a scanned room together, from tracked poses of the scanner on.

    The fragments are listed in YAML: scans as `{scan: FILE, world_from_scan: POSE}`, depth images in whole mm as
    `{depth: FILE, world_from_cam: POSE}` with `camera: FILE` beside the list.

    Args:
        fragments: the YAML file; docs/calibrating.md has an example.
        out: the room as a PLY of points, in the world of motion capture; a capture takes it as `room`.
        spacing: between points, in mm.
        farthest: depth that counts, in m.
    """
    check_installed("aligning a room", "scipy", "trimesh", "small_gicp", extra="simulate")
    from evimo.calibrating.fragments import PASSES, align_fragments
    from evimo.calibrating.rigid import moved
    from evimo.captures.entries import load_entries

    if not 1 <= spacing <= 200 or not farthest > 0:
        raise BadInput("impossible sizes", fix="--spacing from 1 to 200 mm, --farthest above 0 m")
    if out.suffix.lower() != ".ply":
        raise BadInput(f"--out is {out}", fix="a file that ends in .ply")
    entry = load_entries(fragments)
    names, points, tracked = _loaded(entry, farthest)
    with progress(PASSES * len(points), "alignments") as advance:
        room = align_fragments(points, tracked, spacing_m=spacing / 1e3, advance=lambda: advance())
    _show(names, room)
    placed = np.concatenate([moved(pose, each) for pose, each in zip(room.world_from_scan, points, strict=True)])
    whole = _thinned(placed, spacing / 1e3)
    with new_file(out) as file:
        _write_ply(file, whole)
    print(f"saved {out}: {len(whole):,} points; `room: {{scan: {out.name}}}` in capture.yaml")


def _loaded(entry: "Entry", farthest_m: float) -> tuple[list[str], list[np.ndarray], np.ndarray]:
    """Names, points on the scanner's axes and tracked poses of all fragments."""
    fields = entry.fields(("fragments",), ("camera", "unit"))
    camera = fields["camera"].path() if "camera" in fields else None
    unit = fields["unit"].text() if "unit" in fields else "m"
    names: list[str] = []
    points: list[np.ndarray] = []
    poses: list[np.ndarray] = []
    for each in fields["fragments"].entries():
        kind = "depth" if "depth" in each.named() else "scan"
        parts = each.fields((kind, "world_from_cam" if kind == "depth" else "world_from_scan"))
        path = parts[kind].path()
        names.append(path.name)
        poses.append(parts["world_from_cam" if kind == "depth" else "world_from_scan"].pose())
        points.append(_depth_image(each, path, camera, farthest_m) if kind == "depth" else _scan(each, path, unit))
    if len(points) < 2:
        raise fields["fragments"].wrong(f"are {len(points)}", fix="two and more that overlap")
    return names, points, np.array(poses)


def _scan(entry: "Entry", path: Path, unit: str) -> np.ndarray:
    from evimo.captures.scans import UNITS, load_scan

    if unit not in UNITS:
        raise entry.wrong(f"is in {unit!r}", fix=f"`unit`: one of {', '.join(UNITS)}")
    return load_scan(path, unit=unit).points


def _depth_image(entry: "Entry", path: Path, camera_file: Path | None, farthest_m: float) -> np.ndarray:
    from evimo.calibrating.fragments import depth_points
    from evimo.formats.pictures import read_picture
    from evimo.geometry.calibration import load_camera

    depth_mm = read_picture(path)
    if depth_mm is None or depth_mm.ndim != 2 or depth_mm.dtype != np.uint16:
        raise BadFile(f"{path} is no depth image", fix="a PNG with one channel of 16 bits, in mm")
    if camera_file is None:
        raise entry.wrong("is a depth image, but there is no `camera: FILE`")
    camera = load_camera(camera_file, size=(depth_mm.shape[0], depth_mm.shape[1]))
    grid, valid = camera.normalised(camera.pixels())
    return depth_points(np.asarray(depth_mm, np.float64) / 1e3, grid, valid, farthest_m=farthest_m)


def _show(names: list[str], room: "AlignedRoom") -> None:
    for name, shift_m, turn_rad, aligned in zip(names, room.moved_m, room.turned_rad, room.aligned, strict=True):
        how = "" if aligned else ", NOT ALIGNED: too little in common with the others"
        print(f"  {name}: {1e3 * shift_m:.1f} mm, {np.degrees(turn_rad):.3f} degrees from where it was tracked{how}")
    print(f"  gap between fragments: median {1e3 * room.before_m:.1f} mm as tracked, {1e3 * room.after_m:.1f} mm now")


def _thinned(points: np.ndarray, spacing_m: float) -> np.ndarray:
    """The middle of the points in every cube of this size."""
    cubes = np.floor((points - points.min(axis=0)) / spacing_m).astype(np.int64)
    _, place, count = np.unique(cubes, axis=0, return_inverse=True, return_counts=True)
    sums = [np.bincount(place.ravel(), points[:, axis]) for axis in range(3)]
    return np.stack(sums, axis=1) / count[:, None]


def _write_ply(path: Path, points: np.ndarray) -> None:
    header = "ply\nformat binary_little_endian 1.0\n"
    header += f"element vertex {len(points)}\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    path.write_bytes(header.encode() + points.astype("<f4").tobytes())
