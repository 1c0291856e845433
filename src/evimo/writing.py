"""Write beside and rename: what exists under its own name is complete, and one marker hides what is not.

New files come about in a hidden folder `.unfinished-…` beside their place and are moved there when they are whole. A
process holds a lock in its hidden folder for as long as it lives, so that the next one that writes there knows which
of these folders belong to nobody any more, and removes them.
"""

import errno
import os
import secrets
import shutil
from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Self

from evimo.errors import BadInput
from evimo.locks import LOCK, locked, remove

MARKER = ".unfinished-"  # hidden, so that whatever passes over hidden folders passes over it
FIX = "another --out, or more room on the disk"
DISK = ("ENOSPC", "EDQUOT", "EFBIG", "EROFS", "EIO", "ESTALE", "ENODEV", "ENXIO", "ENOTCONN")
"""What only a disk says, whatever the file."""


class OutputFolder:
    """Collects new files and folders beside a folder's old content, and moves them in when all are complete.

    Used as a context: leaving it without `keep` throws the new ones away and leaves the old ones as they were.
    """

    def __init__(self, folder: str | Path, *, fix: str = FIX, names: Path | None = None) -> None:
        """Make nothing yet.

        Args:
            folder: where the outputs belong; it is made where it is missing.
            fix: of the error that a disk causes.
            names: what that error names; the folder by default.
        """
        self.folder, self._fix, self._names = Path(folder), fix, names or Path(folder)
        self._made: list[Path] = []
        self._hidden = self.folder / MARKER  # until it has a name of its own

    def __enter__(self) -> Self:
        """Make the folders.

        Raises:
            BadInput: they cannot be made or written.
        """
        self._made = [path for path in (self.folder, *self.folder.parents) if not path.exists()]
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            remove_leftovers(self.folder)
            self._lock = self._begun()
        except BaseException as error:  # a signal may come at any of these lines
            shutil.rmtree(self._hidden, ignore_errors=True)
            self._remove_made()
            if isinstance(error, OSError) and _is_about(error, self.folder):
                raise _unwritable(self._names, error, self._fix) from error
            raise
        return self

    def _begun(self) -> BinaryIO:
        """Make the hidden folder, and return its lock; another one where somebody takes it for a leftover before.

        Its name is known before it is made, so that it can be removed whatever happens.

        Raises:
            OSError: it cannot be made.
        """
        while True:
            self._hidden = self.folder / f"{MARKER}{secrets.token_hex(6)}"
            self._hidden.mkdir(mode=0o700)
            with suppress(FileNotFoundError):
                if (lock := locked(self._hidden, unsure=True)) is not None:
                    return lock

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Remove what was not kept.

        Raises:
            BadInput: the disk was full, or could not be written any more.
        """
        try:
            self._remove_hidden()
        except BaseException:  # a signal that came meanwhile
            self._remove_hidden()
            raise
        if isinstance(error, OSError) and _is_about(error, self.folder):
            raise _unwritable(self._names, error, self._fix) from error

    def path(self, name: str) -> Path:
        """Where to write the new file or folder `name` until it is complete."""
        return self._hidden / name

    def left_over(self, names: Iterable[str]) -> list[str]:
        """Which of these files are in the folder from before and will not be replaced."""
        return [name for name in names if (self.folder / name).exists() and not self.path(name).exists()]

    def keep(self, *names: str) -> list[Path]:
        """Give these their names in the folder, or all that there are; their paths, sorted.

        New files replace old ones of the same name. A folder that another process has completed meanwhile stays.

        Raises:
            BadInput: a folder, a pipe or a device is in the way of a file.
        """
        new = sorted(names) or sorted(path.name for path in self._hidden.iterdir() if path.name != LOCK)
        for name in new:
            if not self.path(name).is_dir():
                _check_replaceable(self.folder / name)
        with explained(self._names, fix=self._fix):
            for name in new:
                if not (self.folder / name).is_dir():
                    os.replace(self.path(name), self.folder / name)
        return [self.folder / name for name in new]

    def _remove_hidden(self) -> None:
        remove(self._hidden, self._lock)
        self._remove_made()

    def _remove_made(self) -> None:
        for made in self._made:
            with suppress(OSError):  # not empty
                made.rmdir()


@contextmanager
def new_file(path: str | Path, *, fix: str = FIX) -> Generator[Path]:
    """Where to write a file, which appears under its name, over an older one's, when the `with` ends without an error.

    Raises:
        BadInput: it cannot be written, or the disk is full.
    """
    path = Path(path)
    _check_replaceable(path)
    with OutputFolder(path.parent, fix=fix, names=path) as outputs:
        yield outputs.path(path.name)
        outputs.keep(path.name)


@contextmanager
def new_folder(path: str | Path, *, fix: str = FIX) -> Generator[Path]:
    """An empty folder to fill, which appears under its name when the `with` ends without an error.

    Raises:
        BadInput: it cannot be written, or the disk is full.
    """
    path = Path(path)
    with OutputFolder(path.parent, fix=fix, names=path) as outputs:
        outputs.path(path.name).mkdir()
        yield outputs.path(path.name)
        outputs.keep(path.name)


def in_utf8(text: str) -> str:
    """Return a text that can be written: what UTF-8 cannot hold of a file's name is escaped, as JSON would have it."""
    return text.encode(errors="backslashreplace").decode()


def save_text(text: str, path: str | Path) -> None:
    """Save a text as UTF-8, in one piece or not at all; folders are made.

    Raises:
        BadInput: it cannot be written, or the disk is full.
    """
    with new_file(path) as file:
        file.write_text(in_utf8(text), encoding="utf-8", newline="")


def save_files(folder: str | Path, contents: Mapping[str, str | bytes]) -> None:
    """Save several files, texts as UTF-8, in a folder by name: all of them or none; folders are made.

    Raises:
        BadInput: they cannot be written, or the disk is full.
    """
    with OutputFolder(folder) as outputs:
        for name, content in contents.items():
            outputs.path(name).write_bytes(in_utf8(content).encode() if isinstance(content, str) else content)
        outputs.keep()


@contextmanager
def held_folder(parent: Path) -> Generator[Path]:
    """A hidden folder that this process holds while the `with` lasts, so that others see by it that it lives."""
    with OutputFolder(parent) as outputs:
        yield outputs.path(LOCK).parent


def is_held(hidden: Path) -> bool:
    """Whether somebody holds a hidden folder, if need be on another machine; of what cannot be locked, it is there."""
    try:
        lock = locked(hidden, unsure=False)
    except OSError as error:
        return error.errno != errno.ENOENT
    if lock is not None:
        lock.close()
    return lock is None


def make_folder(folder: Path, *, fix: str = FIX) -> None:
    """Make a folder where it is missing, and make sure that it can be written: now rather than after hours of work.

    Raises:
        BadInput: it cannot be made or written.
    """
    with explained(folder, fix=fix):
        folder.mkdir(parents=True, exist_ok=True)
    with OutputFolder(folder, fix=fix):
        pass


@contextmanager
def explained(path: Path, *, fix: str = FIX) -> Generator[None]:
    """Turn what the system says of a path that is made or written into our error; what it says of others stays.

    Raises:
        BadInput: it cannot be written, or the disk is full.
    """
    try:
        yield
    except OSError as error:
        if not _is_about(error, path):
            raise
        raise _unwritable(path, error, fix) from error


def shown(paths: Iterable[Path], *, below: Path) -> Iterator[Path]:
    """Those of some paths in or below a folder that are not hidden in it: what is unfinished is."""
    return (path for path in paths if not any(part.startswith(".") for part in path.relative_to(below).parts))


def remove_leftovers(folder: Path) -> None:
    """Remove what processes that were killed have left unfinished in a folder; what others write now stays."""
    try:
        left = [path for path in folder.iterdir() if path.name.startswith(MARKER)]
    except OSError:  # it may not be listed: then neither can anything in it be removed
        return
    for path in left:
        with suppress(OSError):
            lock = locked(path, unsure=False)
            if lock is not None:
                remove(path, lock)


def _check_replaceable(path: Path) -> None:
    """Make sure that a new file may take the place of what is there: root could replace even `/dev/null`.

    Raises:
        BadInput: it is no file.
    """
    if path.exists() and not path.is_file() and not path.is_dir():
        raise BadInput(f"cannot write {path}: it is a pipe or a device", fix="the name of a file")
    if path.is_dir():
        raise BadInput(f"cannot write {path}: it is a folder", fix="another name, or remove it")


def _is_about(error: OSError, path: Path) -> bool:
    """Whether an error says that a disk is full or gone, or names what is written: it, what is in it, where it is."""
    if errno.errorcode.get(error.errno or 0) in DISK:
        return True
    named = [Path(name) for name in (error.filename, error.filename2) if isinstance(name, str)]
    return any(path in (name, *name.parents) or name in path.parents for name in named)


def _unwritable(path: Path, error: OSError, fix: str) -> BadInput:
    return BadInput(f"cannot write {path}: {error.strerror or error}", fix=fix)
