"""Scans of objects and rooms: points or triangles in metres, and where the markers of motion capture sit on them."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, NotFound
from evimo.scene.meshes.files import FIX, MARKERS, SCAN, SUFFIXES, stored_shape

F8 = NDArray[np.float64]
I8 = NDArray[np.int64]

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
MARKER_LINES = "lines of `number x y z`, one for each marker, in the scan's own coordinates"


@dataclass(frozen=True, slots=True)
class Scan:
    """The surface of something, in its own axes.

    path:      the file.
    points:    (N, 3), m.
    triangles: (T, 3) of their indices; T is 0 where the scanner gave points alone.
    markers:   (K, 3) centres of the markers of motion capture, m; K is 0 where nobody has located them.
    """

    path: Path
    points: F8
    triangles: I8
    markers: F8

    @property
    def is_cloud(self) -> bool:
        """Whether it is points alone."""
        return not len(self.triangles)


def load_scan(path: str | Path, *, unit: str = "m", markers: str | Path | None = None) -> Scan:
    """Load a scan: PLY, OBJ, STL, OFF or GLB, or a folder as EV-IMO has one for each object.

    Args:
        path: the file; or a folder with `model.ply` and, where the markers are known, `config.txt`.
        unit: of the file and of its markers, m, cm or mm.
        markers: a text with a line `number x y z` for each marker, in the scan's coordinates.

    Raises:
        NotFound: there is no such file, or no scan in the folder.
        BadFile: the file is none of its format, holds no point, or a line of the markers is none.
    """
    file = _scan_file(Path(path))
    beside = file.with_name(MARKERS)
    listed = Path(markers) if markers is not None else beside if beside.exists() and file.stem == SCAN else None
    points, triangles = stored_shape(file)
    if not len(triangles):
        points = points[np.isfinite(points).all(axis=1)]  # depth cameras store what they did not see as NaN
    if not len(points):
        raise BadFile(f"{file} holds neither triangles nor points", fix=FIX)
    if not np.isfinite(points).all():
        raise BadFile(f"{file} has vertices that are infinite or no numbers", fix=FIX)
    if len(triangles) and (triangles.min() < 0 or triangles.max() >= len(points)):
        raise BadFile(f"{file} has triangles of vertices beyond its {len(points):,}", fix=FIX)
    scale = UNITS[unit]
    centres = load_marker_centres(listed) if listed else np.zeros((0, 3))
    return Scan(file, points * scale, triangles, centres * scale)


def load_marker_centres(path: Path) -> F8:
    """Marker centres (K, 3) of a text such as EV-IMO's `config.txt`, in its own unit, in the order of its lines.

    Raises:
        NotFound: there is no such file. BadFile: a line is not `number x y z`.
    """
    if not path.is_file():
        raise NotFound(f"there is no file of markers {path}", fix=MARKER_LINES)
    rows: list[list[float]] = []
    for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1):
        words = re.split(r"[\s,;]+", line.partition("#")[0].strip())
        if words == [""]:
            continue
        try:
            row = [float(word) for word in words[1:]]
        except ValueError:
            row = []
        if len(row) != 3 or not np.isfinite(row).all():
            raise BadFile(f"{path}, line {number}: {line.strip()[:60]!r} is no marker", fix=MARKER_LINES)
        rows.append(row)
    return np.array(rows, np.float64).reshape(-1, 3)


def _scan_file(path: Path) -> Path:
    """The file of a scan, in a folder `model.ply` or of another format.

    Raises:
        NotFound: there is none.
    """
    if path.is_dir():
        found = [file for suffix in SUFFIXES if (file := path / f"{SCAN}{suffix}").is_file()]
        if not found:
            raise NotFound(f"there is no {SCAN}.ply in the folder {path}", fix=f"a file of {', '.join(SUFFIXES)}")
        return found[0]
    if not path.is_file():
        raise NotFound(f"there is no scan {path}", fix=f"a file of {', '.join(SUFFIXES)}")
    if path.suffix.lower() not in SUFFIXES:
        raise BadFile(f"{path} is no scan by its name", fix=f"a file of {', '.join(SUFFIXES)}")
    return path
