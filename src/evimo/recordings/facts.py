"""How a simulated recording was made, as it tells itself."""

import json
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from evimo.errors import BadFile
from evimo.formats.hdf5_file import opened_hdf5
from evimo.formats.npz_members import Archive

FACTS = "sim_facts"  # in an .npz file
MARK = "evimo"  # the attribute of an HDF5 file
DAMAGED = "simulate it again, or copy the whole recording again"


def own_version() -> str:
    """The version of this package, as recordings and reports tell it."""
    try:
        return version("evimo")
    except PackageNotFoundError:
        return "unknown"


def facts_of(path: Path) -> dict[str, Any]:
    """Camera, seed, sensor, version of a recording in any of this package's layouts.

    Raises:
        BadFile: it does not tell, or what it tells is damaged; nothing is ever unpickled.
    """
    if path.is_dir():
        return _folder_facts(path / "dataset_info.json")
    return _archive_facts(path) if path.suffix == ".npz" else _hdf5_facts(path)


def _folder_facts(path: Path) -> dict[str, Any]:
    if not path.exists():
        raise BadFile(f"{path.parent} lacks {path.name}", fix="a folder that `evimo simulate` has written")
    try:
        return dict(json.loads(path.read_text())["evimo"])
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise BadFile(f"{path} is not the JSON of a simulated recording", fix=DAMAGED) from error


def _archive_facts(path: Path) -> dict[str, Any]:
    archive = Archive(path)
    if archive.cut_short:
        raise BadFile(f"{path} was cut short", fix=DAMAGED)
    if FACTS not in archive.names:
        fix = f"`evimo run {path}`: of what others made, the events are read; poses in a pickle stay closed"
        raise BadFile(f"{path} was not written by `evimo simulate`", fix=fix)
    try:
        return dict(json.loads(str(archive.value(FACTS))))
    except (ValueError, TypeError, RecursionError) as error:
        raise BadFile(f"{path} does not tell how it was simulated", fix=DAMAGED) from error


def _hdf5_facts(path: Path) -> dict[str, Any]:
    try:
        with opened_hdf5(path) as file:
            return dict(json.loads(str(file.attrs[MARK])))
    except (ValueError, KeyError, TypeError, OSError, RuntimeError) as error:
        raise BadFile(f"{path} does not tell how it was made", fix=DAMAGED) from error
