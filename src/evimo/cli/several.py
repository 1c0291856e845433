"""Commands over several recordings: each has a place of its own, and what is finished is not done again."""

from collections import Counter
from collections.abc import Sequence
from functools import partial
from os.path import commonpath
from pathlib import Path

from evimo.cli.asked import Asked, heard_warnings
from evimo.cli.progress import progress
from evimo.errors import BadInput
from evimo.jobs.crew import Crew
from evimo.jobs.finishing import finished
from evimo.writing import make_folder


def run_several(asked: Asked, folders: dict[Path, Path], *, crew: Crew, shared: Path) -> int:
    """Run over each recording and leave its outputs in its folder; return how many were done now.

    Raises:
        BadInput: `shared`, in which the folders are, cannot be written. EvimoError: of a recording, or of the model.
    """
    from evimo.streaming.models import model_of

    identity = model_of(asked.model).identity
    make_folder(shared)
    missing = [pair for pair in folders.items() if not asked.is_done(*pair, identity)]
    with progress(len(folders), "recordings") as advance:
        advance(len(folders) - len(missing), made=False)
        work = partial(_run_one, asked, identity)
        for _ in finished(work, missing, crew=crew, shared=shared, name=lambda pair: pair[0]):
            advance()
    return len(missing)


def folders_of(recordings: Sequence[Path], out: Path) -> dict[Path, Path]:
    """A folder in `out` for each recording, named like it; where names are the same, with the folders they are in.

    Raises:
        BadInput: two of them would have the same folder.
    """
    whole = [recording.resolve() for recording in recordings]
    names = [Path(path.stem or "recording") for path in whole]
    if max(Counter(names).values()) > 1:
        above = Path(commonpath([path.parent for path in whole]))
        names = [path.relative_to(above).with_suffix("") for path in whole]
    folders = {recording: out / name for recording, name in zip(recordings, names, strict=True)}
    check_apart(folders)
    return folders


def check_apart(targets: dict[Path, Path]) -> None:
    """Make sure that no two of several inputs would be written to the same place.

    Raises:
        BadInput: they would.
    """
    for target, count in Counter(targets.values()).items():
        if count > 1:
            same = [str(path) for path, other in targets.items() if other == target]
            raise BadInput(f"{' and '.join(same)} would both be written to {target}", fix="another --out for each")


def _run_one(asked: Asked, identity: dict[str, str], pair: tuple[Path, Path]) -> None:
    """One of the runs, unless it is done."""
    recording, folder = pair
    if asked.is_done(recording, folder, identity):
        return
    from evimo.streaming.saving import Control, save_run

    with heard_warnings() as heard:
        prepared = asked.prepared(recording)
        wanted = asked.wanted(prepared)
        save_run(prepared, folder, wanted, settings=asked.settings, control=Control(warnings=heard))
