"""Which recordings with truth lie in a folder."""

from collections.abc import Iterable
from pathlib import Path

from evimo.errors import NotFound
from evimo.recordings.recording import knows_truth
from evimo.writing import shown

INFO = "dataset_info.json"


def recordings_in(paths: Iterable[Path]) -> list[Path]:
    """Return the recordings with truth, folders and .npz files, sorted within each path, each once.

    Raises:
        NotFound: a path holds none. BadFile: an .npz file is none.
    """
    found: dict[Path, None] = {}
    for path in paths:
        recordings = [path] if path.is_file() and knows_truth(path) else _recordings_below(path)
        if not recordings:
            raise NotFound(
                f"no recording in {str(path)!r}",
                fix=f"a folder with {INFO}, such as evimo simulate --set 1 --minutes 1 --seed 7 --out DIR makes",
            )
        found.update(dict.fromkeys(recordings))
    if not found:
        raise NotFound("no recording given", fix="evimo evaluate FOLDER, with recordings from evimo simulate")
    return list(found)


def _recordings_below(path: Path) -> list[Path]:
    """Finished ones: what is being written is hidden."""
    folders = [file.parent for file in path.rglob(INFO)]
    files = [file for file in path.rglob("*.npz") if not file.name.startswith("dataset_") and knows_truth(file)]
    return sorted(shown(folders + files, below=path))
