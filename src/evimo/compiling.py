# pyright: basic
"""Functions that numba compiles: one decorator, which keeps compiled code where it can, and says what it compiles.

Numba keeps it beside the source file, else below the user's home, and refuses to work where neither can be written, as
in a container whose user has no home. Here it is then kept in the user's own part of the temporary folder, or not at
all, with a warning. It holds what its module imports from others of ours, too, and is made anew where those change.
"""

import os
import pickle
import re
import stat
import tempfile
import time
import warnings
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from evimo.errors import EvimoWarning

EVERY_S = 10.0  # between two lines that say what is being compiled
FOLDER = "evimo-compiled"
ADVICE = "each run compiles anew; set NUMBA_CACHE_DIR to a folder that can be written"
ROOT = Path(__file__).parent
IMPORT = re.compile(r"^from evimo\.([\w.]+) import", re.MULTILINE)
UNREADABLE = (OSError, EOFError, pickle.UnpicklingError)  # of compiled code that was cut short

_listeners: list[Callable[[str], None]] = []
_warned: list[str] = []


def njit(**options: Any) -> Callable[[Any], Any]:
    """Decorate as `numba.njit` does, and keep the compiled code where it can be written."""

    def compiled(function: Any) -> Any:
        _listen()
        try:
            made = _made(function, options, cache=True)
        except RuntimeError as error:
            if "no locator available" not in str(error):
                raise
            made = _kept_elsewhere(function, options)
        _stamp(made, Path(function.__code__.co_filename))
        _forgive(made)
        return made

    return compiled


def is_kept(made: Any) -> bool:
    """Whether code of a compiled function is kept for later processes, of whatever state; True where none can be."""
    index: Any = getattr(getattr(made, "_cache", None), "_cache_file", None)
    path: Any = getattr(index, "_index_path", None)
    return path is None or Path(path).exists()


@contextmanager
def announced(say: Callable[[str], None]) -> Generator[None]:
    """Call `say` with a line about what is being compiled, now and then, while the `with` lasts."""
    _listeners.append(say)
    try:
        yield
    finally:
        _listeners.remove(say)


def _made(function: Any, options: dict[str, Any], *, cache: bool) -> Any:
    import numba  # takes half a second, which `evimo --help` does not need

    make: Any = numba.njit
    return make(**options | {"cache": cache})(function)


def _kept_elsewhere(function: Any, options: dict[str, Any]) -> Any:
    """Compiled code kept in the temporary folder, or not at all."""
    from numba.core import config as numba_config

    config: Any = numba_config
    folder = _temporary_folder()
    if folder is None:
        return _made(function, options, cache=False)
    before = config.CACHE_DIR
    config.CACHE_DIR = str(folder)  # read once, by what the decorator makes
    try:
        return _made(function, options, cache=True)
    finally:
        config.CACHE_DIR = before


@cache
def _temporary_folder() -> Path | None:
    """A folder that nobody else can write, since compiled code is read from it; None, with a warning, without one."""
    try:
        user = f"-{os.getuid()}" if hasattr(os, "getuid") else ""
        folder = Path(tempfile.gettempdir()) / f"{FOLDER}{user}"
        folder.mkdir(mode=0o700, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
        if not _is_ours(folder):
            raise PermissionError(f"{folder} belongs to somebody else")
    except OSError as error:
        _warn_once(str(error))
        return None
    return folder


def _is_ours(folder: Path) -> bool:
    found = folder.lstat()
    if not hasattr(os, "getuid"):  # Windows: each user has a temporary folder
        return stat.S_ISDIR(found.st_mode)
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o022


def _stamp(made: Any, file: Path) -> None:
    """Mark compiled code with the state of what its module imports; numba marks it with that of the module alone."""
    index: Any = getattr(getattr(made, "_cache", None), "_cache_file", None)
    stamp: Any = getattr(index, "_source_stamp", None)  # private: where a numba has none, its own mark stays
    if stamp is not None:
        states = [(each.name, each.stat().st_mtime, each.stat().st_size) for each in sorted(_imported(file))]
        index._source_stamp = (stamp, states)


@cache
def _imported(file: Path) -> frozenset[Path]:
    """Our modules that one with compiled functions imports, and those that these import, as far as they have some."""
    if ROOT not in file.parents or not file.is_file() or "@njit" not in (text := file.read_text(encoding="utf-8")):
        return frozenset()
    paths = (ROOT / f"{name.replace('.', '/')}.py" for name in IMPORT.findall(text) if name != "compiling")
    direct = frozenset(path for path in paths if path.is_file())
    return direct.union(*map(_imported, direct))


def _forgive(made: Any) -> None:
    """Compiled code that cannot be kept or read again, on a full disk or after a power cut, is no reason to stop."""
    kept: Any = getattr(made, "_cache", None)
    if not hasattr(kept, "save_overload"):  # NUMBA_DISABLE_JIT leaves the plain function
        return
    usual_save, usual_load = kept.save_overload, kept.load_overload

    def save(*of: Any) -> None:
        try:
            usual_save(*of)
        except UNREADABLE as error:
            _warn_once(str(error))

    def load(*of: Any) -> Any:
        try:
            return usual_load(*of)
        except UNREADABLE:
            return None

    kept.save_overload, kept.load_overload = save, load


def _warn_once(reason: str) -> None:
    if not _warned:
        _warned.append(reason)
        warnings.warn(f"compiled code cannot be kept ({reason}): {ADVICE}", EvimoWarning, stacklevel=2)


@cache
def _listen() -> None:
    """Hear of each function that numba compiles from now on."""
    from numba.core import event

    class Compiling(event.Listener):
        def __init__(self) -> None:
            self.count, self.said_s = 0, 0.0

        def on_start(self, event: Any) -> None:
            self.count += 1
            module = event.data["dispatcher"].py_func.__module__
            if not module.startswith("evimo.") or time.monotonic() - self.said_s < EVERY_S:
                return
            first, self.said_s = not self.said_s, time.monotonic()
            begun = "compiling for this processor, once after an installation" if first else "still compiling"
            for say in _listeners:
                say(f"{begun}: {module}")

        def on_end(self, event: Any) -> None:
            pass

    event.register("numba:compile", Compiling())
