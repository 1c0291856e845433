"""Which recordings with truth lie in a folder: the one finder of every command."""

from collections.abc import Iterable
from pathlib import Path

from evimo.errors import EvimoError, NotFound
from evimo.recordings.layouts import MARKS, SUFFIXES, knows_truth, layout_of
from evimo.recordings.splits import Part, part_of_split
from evimo.writing import shown


def recordings_in(paths: Iterable[Path], *, split: str = "", part: Part = "test") -> list[Path]:
    """Return the recordings with truth in any layout, sorted within each path, each once.

    Args:
        paths: recordings, or folders that hold them.
        split: the name of a published split, of whose part only recordings are kept; all of them without.
        part: `train` or `test`.

    Raises:
        NotFound: a path holds none, or none of that part. BadFile: an .npz file is none, or a folder of EVIMO2 has no
            events. BadInput: no such split.
    """
    found: dict[Path, None] = {}
    for path in paths:
        recordings = [path] if path.exists() and knows_truth(path) else _recordings_below(path)
        if not recordings:
            raise _nothing_in(path)
        found.update(dict.fromkeys(recordings))
    if not found:
        raise NotFound("no recording given", fix="evimo evaluate FOLDER, with recordings from evimo simulate")
    return part_of_split(list(found), split, part) if split else list(found)


def _nothing_in(path: Path) -> EvimoError:
    """Why a path holds no recording with truth."""
    if path.is_file() and path.suffix == ".bag":
        return NotFound(f"{path} is a bag, which holds no maps of truth", fix="`evimo annotate` makes them, with scans")
    if (path / "dataset_info.npz").exists():
        try:
            layout_of(path)
        except EvimoError as error:
            return error
    return NotFound(
        f"no recording with truth in {str(path)!r}",
        fix="one of EV-IMO or EVIMO2, or what evimo simulate --set 1 --minutes 1 --seed 7 --out DIR makes",
    )


def _recordings_below(path: Path) -> list[Path]:
    """Finished ones: what is being written is hidden."""
    folders = {file.parent for mark in MARKS for file in path.rglob(mark)}
    files = [file for suffix in SUFFIXES for file in path.rglob(f"*{suffix}") if not file.name.startswith("dataset_")]
    return sorted(each for each in shown([*folders, *files], below=path) if knows_truth(each))
