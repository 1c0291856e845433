"""Which layout a recording with truth is in: those of EV-IMO and EVIMO2, and those that this package writes."""

from pathlib import Path
from typing import Literal

from evimo.errors import BadFile
from evimo.formats.npz_members import Archive
from evimo.recordings.datasets import DatasetLayout, dataset_layout
from evimo.recordings.facts import FACTS
from evimo.recordings.hdf5_layout import is_own_hdf5

OwnLayout = Literal["folder", "archive", "hdf5"]
Layout = OwnLayout | DatasetLayout | Literal["EV-IMO bag"]

OWN_FILES = ("dataset_sim.npz", "dataset_clutter.npz", "dataset_info.json")  # only our own folders have them
MARKS = ("dataset_info.json", "dataset_sim.npz", "dataset_info.npz", "meta.txt")
"""Files by which the folder of a recording is found."""
SUFFIXES = (".npz", ".h5", ".hdf5")
"""Of recordings that are one file, and are looked for in folders; bags hold no maps and are opened by name only."""


def found_layout(path: Path) -> Layout | None:
    """The layout of a folder or file, be it whole or damaged; None where it holds no truth.

    Raises:
        BadFile: an .npz file in which nothing can be found.
    """
    if path.is_dir():
        if any((path / name).exists() for name in OWN_FILES):
            return "folder"
        return dataset_layout(path)
    if path.suffix == ".npz" and path.is_file() and not path.name.startswith("dataset_"):
        return "archive" if FACTS in Archive(path).names else dataset_layout(path)
    if path.suffix in (".h5", ".hdf5") and path.is_file():
        return "hdf5" if is_own_hdf5(path) else None
    return "EV-IMO bag" if path.suffix == ".bag" and path.is_file() else None


def layout_of(path: Path) -> Layout:
    """The layout of a recording with truth.

    Raises:
        BadFile: it holds none.
    """
    if path.is_dir() and (path / "dataset_info.npz").exists() and found_layout(path) is None:
        fix = "the same sequence in left_camera, right_camera or samsung_mono"
        raise BadFile(f"{path} holds no events, as those of EVIMO2's frame camera flea3_7", fix=fix)
    if path.is_dir() and (path / "dataset_events_t.npy").exists() and found_layout(path) is None:
        raise BadFile(f"{path} holds events and no truth: it lacks dataset_info.npz", fix=f"`evimo run {path}`")
    if path.is_dir() and (path / "events.txt").exists() and found_layout(path) is None:
        raise BadFile(f"{path} holds events and no truth: it lacks meta.txt", fix=f"`evimo run {path}/events.txt`")
    layout = found_layout(path)
    if layout is None:
        fix = f"`evimo run {path}`, which needs none; or a recording of EV-IMO, EVIMO2 or `evimo simulate`"
        raise BadFile(f"{path} holds no truth that is known here (no `sim_facts`, no `meta`)", fix=fix)
    return layout


def knows_truth(path: Path) -> bool:
    """Whether a folder or file is a recording with maps of truth, be it whole or damaged.

    Raises:
        BadFile: an .npz file in which nothing can be found.
    """
    return found_layout(path) not in (None, "EV-IMO bag")
