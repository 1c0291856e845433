"""`evimo convert`: recordings with truth from one layout to another."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from evimo.cli.progress import progress
from evimo.cli.several import check_apart
from evimo.jobs.crew import ALONE, Crew
from evimo.writing import make_folder


def convert(
    *paths: Path,
    layout: Literal["evimo1", "evimo2", "hdf5"] = "evimo2",
    out: Path,
    split: str = "",
    crew: Annotated[Crew, Parameter(name="*")] = ALONE,
) -> None:
    """Write recordings of EV-IMO, EVIMO2 or `evimo simulate` in another layout, without pickles.

    evimo convert /data/EV-IMO/eval --layout hdf5 --out /data/evimo_h5

    The folders below each path are kept. The same command again makes only what is missing.

    Args:
        paths: recordings with truth in any layout, or folders that hold them.
        layout: `evimo2`, folders of memory-mapped arrays, which are fastest; `evimo1`, one .npz each; `hdf5`, one file
            each in compressed chunks.
        out: folder for the new ones.
        split: only recordings of a published split, both of its parts, such as `paper2019`.
        crew: who converts; each a whole recording.
    """
    crew.check()
    from evimo.recordings.converting import convert_recordings
    from evimo.recordings.finding import recordings_in
    from evimo.recordings.writers import SUFFIXES

    make_folder(out)
    found = recordings_in(paths)
    if split:
        found = sorted({path for part in ("train", "test") for path in _part(found, split, part)})
    targets = {path: _target(path, paths, out, SUFFIXES[layout]) for path in found}
    check_apart(targets)
    there = sum(target.exists() for target in targets.values())
    with progress(len(found), "recordings") as advance:
        advance(there, made=False)
        written = sum(1 for _ in convert_recordings(targets, layout, out, crew=crew, progress=advance))
    print(f"{written} of {len(found)} recordings written in {out}{f'; {there} were there' if there else ''}")


def _part(found: list[Path], split: str, part: Literal["train", "test"]) -> list[Path]:
    """The recordings of one part; none where the split's other part alone is there."""
    from evimo.errors import NotFound
    from evimo.recordings.splits import part_of_split

    try:
        return part_of_split(found, split, part)
    except NotFound:
        return []


def _target(path: Path, given: tuple[Path, ...], out: Path, suffix: str) -> Path:
    """Where a recording goes: as far below `out` as it lies below the path that was given, under its own name."""
    root = next((root for root in given if path != root and path.is_relative_to(root)), path.parent)
    name = path.name if path.is_dir() else path.stem
    return out / path.relative_to(root).with_name(name + suffix)
