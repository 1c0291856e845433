"""A user's own folders: which files of them are taken, and a digest that tells two folders apart."""

import hashlib
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from evimo.errors import BadFile, BadInput, EvimoWarning, NotFound
from evimo.writing import shown

OUT = "another copy of it, or take it out of the folder"


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
            for part in (file.relative_to(self.folder).as_posix().encode(errors="surrogateescape"), content_of(file)):
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
        NotFound: there is no such folder, or no such file in it. BadInput: it may not be read.
    """
    kinds = ", ".join(suffixes)
    try:
        if not folder.is_dir():
            raise NotFound(f"there is no folder {folder}", fix=f"a folder with {what} ({kinds})")
        within = list(folder.rglob("*") if deep else folder.iterdir())
        found = sorted(
            (file for file in within if file.is_file()), key=lambda file: file.relative_to(folder).as_posix()
        )
    except OSError as error:
        raise BadInput(f"{folder} cannot be read: {error.strerror}", fix=f"a folder with {what} ({kinds})") from error
    files = [file for file in shown(found, below=folder) if not passed(file)]
    taken = tuple(file for file in files if file.suffix.lower() in suffixes)
    if not taken:
        raise NotFound(f"there are no {what} in {folder}", fix=f"a folder with files of {kinds}")
    return OwnFiles(folder, taken, what, len(files) - len(taken))


def content_of(file: Path) -> bytes:
    """A whole file.

    Raises:
        BadFile: it is empty or may not be read.
    """
    try:
        content = file.read_bytes()
    except OSError as error:
        raise BadFile(f"{file} cannot be read: {error.strerror}", fix=OUT) from error
    if not content:
        raise BadFile(f"{file} is empty (0 bytes)", fix=OUT)
    return content
