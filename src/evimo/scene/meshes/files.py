"""A user's folder of meshes and scans, read whole: PLY, OBJ, STL, OFF and GLB, triangles or points."""

import io
from pathlib import Path
from typing import Any

import numpy as np

from evimo.errors import BadFile
from evimo.scene.meshes.bank import F8, I8, MeshBank, Triangles, in_unit_space, mesh_bank
from evimo.scene.meshes.clouds import surface_of
from evimo.scene.meshes.ply import plain_ply
from evimo.scene.own_files import OwnFiles, content_of, own_files

SUFFIXES = (".ply", ".obj", ".stl", ".off", ".glb")
SCAN, MARKERS = "model", "config.txt"  # an object of EV-IMO is a folder with both; its other files are its markers
MOST_TRIANGLES = 5_000_000
FIX = "export it again, as binary PLY for example, or take it out of the folder"


def mesh_files(folder: Path) -> OwnFiles:
    """The files of a folder, and of those in it, that hold meshes; of an object of EV-IMO its scan alone.

    Raises:
        NotFound: there is no such folder, or no mesh in it.
    """
    return own_files(folder, SUFFIXES, what="meshes", deep=True, passed=_is_marker)


def _is_marker(file: Path) -> bool:
    scans = [file.with_name(SCAN + suffix) for suffix in SUFFIXES]
    return file.stem != SCAN and file.with_name(MARKERS).exists() and any(scan.exists() for scan in scans)


def load_meshes(folder: Path) -> MeshBank:
    """The meshes of a folder by the names of their files.

    Materials and pictures are ignored, and nothing else than these files is opened. Files with points alone are
    meshed; triangles are kept as they are, however many, and all parts of a file become one mesh.

    Raises:
        NotFound: as `mesh_files` says.
        BadFile: a file is none of its format or holds nothing to show.
    """
    return mesh_bank([read_mesh(file) for file in mesh_files(folder).files])


def read_mesh(file: Path) -> Triangles:
    """Vertices (V, 3) and triangles (T, 3) of one file, in its own unit.

    Raises:
        BadFile: as `load_meshes` says.
    """
    vertices, triangles = stored_shape(file)
    if flaw := _flaw(vertices, triangles):
        raise BadFile(f"{file} has {flaw}", fix=FIX)
    try:
        return (vertices, triangles) if len(triangles) else surface_of(vertices)
    except ValueError as error:
        raise BadFile(f"{file} has no triangles, and {error}", fix=FIX) from error


def _flaw(vertices: F8, triangles: I8) -> str:
    """What keeps a mesh from being shown, if anything does."""
    if not len(vertices):
        return "neither triangles nor points"
    if not np.isfinite(vertices).all():
        return "vertices that are infinite or no numbers"
    if not len(triangles):
        return ""
    if len(triangles) > MOST_TRIANGLES:
        return f"{len(triangles):,} triangles, at most {MOST_TRIANGLES:,} are taken"
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        return f"triangles of vertices beyond its {len(vertices):,}"
    try:
        in_unit_space(vertices, triangles)
    except ValueError as error:
        return str(error)
    return ""


def stored_shape(file: Path) -> Triangles:
    """Vertices (V, 3) and triangles (T, 3) of one file as they are stored; T is 0 where it holds points alone.

    Raises:
        BadFile: it is none of its format.
    """
    import trimesh  # takes a second

    content, kind = content_of(file), file.suffix[1:].lower()
    how: dict[str, Any] = {"skip_materials": True} if kind in ("obj", "glb") else {}
    try:
        content = plain_ply(content) if kind == "ply" else content
        loaded: Any = trimesh.load(io.BytesIO(content), file_type=kind, process=False, **how)
        pieces: list[Any] = loaded.dump() if isinstance(loaded, trimesh.Scene) else [loaded]
        return _together(pieces)
    except Exception as error:  # its readers raise whatever they stumble over
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise BadFile(f"{file} cannot be read as {kind.upper()}: {reason}", fix=FIX) from error


def _together(pieces: list[Any]) -> Triangles:
    """All triangles as one mesh; if there are none, all points."""
    solid = [piece for piece in pieces if len(getattr(piece, "faces", ()))]
    vertices = [np.asarray(piece.vertices, np.float64).reshape(-1, 3) for piece in solid or pieces]
    first = np.cumsum([0, *(len(each) for each in vertices)])
    none = np.zeros((0, 3), np.int64)
    triangles = [np.asarray(piece.faces, np.int64) + at for piece, at in zip(solid, first, strict=False)]
    return np.concatenate([np.zeros((0, 3)), *vertices]), np.concatenate([none, *triangles])
