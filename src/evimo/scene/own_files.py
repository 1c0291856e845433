"""A user's own folders: which files of them are taken, and a digest that tells two folders apart."""

import hashlib
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from evimo.errors import EvimoWarning, NotFound


@dataclass(frozen=True)
class OwnFiles:
    """Files of one kind in a folder, sorted by their paths in it.

    what: they are, in the plural. others: how many files there are of other kinds.
    """

    folder: Path
    files: tuple[Path, ...]
    what: str
    others: int = 0

    def warn(self) -> None:
        """Say how many files are left out, if any are."""
        if self.others:
            count = f"{self.others} of {self.others + len(self.files)} files"
            warnings.warn(f"{count} in {self.folder} are no {self.what} and left out", EvimoWarning, stacklevel=2)

    @cached_property
    def sha256(self) -> str:
        """Of the files' paths in the folder and their contents, hexadecimal."""
        whole = hashlib.sha256()
        for file in self.files:
            for part in (file.relative_to(self.folder).as_posix().encode(), file.read_bytes()):
                whole.update(len(part).to_bytes(8, "little") + part)
        return whole.hexdigest()


def own_files(
    folder: Path,
    suffixes: tuple[str, ...],
    *,
    what: str,
    deep: bool = False,
    passed: Callable[[Path], bool] = lambda file: False,
) -> OwnFiles:
    """The files with one of the suffixes, in capitals too; hidden ones are passed over.

    Args:
        folder: where. what: they are, in the plural. deep: in folders of the folder as well.
        passed: true of files that are left out without a word.

    Raises:
        NotFound: there is no such folder, or no such file in it.
    """
    kinds = ", ".join(suffixes)
    if not folder.is_dir():
        raise NotFound(f"there is no folder {folder}", fix=f"a folder with {what} ({kinds})")
    found = sorted(
        folder.rglob("*") if deep else folder.iterdir(), key=lambda file: file.relative_to(folder).as_posix()
    )
    hidden = {file for file in found if any(part.startswith(".") for part in file.relative_to(folder).parts)}
    files = [file for file in found if file not in hidden and file.is_file() and not passed(file)]
    taken = tuple(file for file in files if file.suffix.lower() in suffixes)
    if not taken:
        raise NotFound(f"there are no {what} in {folder}", fix=f"a folder with files of {kinds}")
    return OwnFiles(folder, taken, what, len(files) - len(taken))
