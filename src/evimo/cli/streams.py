"""stdout and stderr as commands find them: letters that a terminal may not have, pipes that close, disks that fill."""

import codecs
import os
import sys
import unicodedata
from collections.abc import Generator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from rich.console import Console

UNKNOWN = 80  # columns, where a terminal says that it has none
PLAIN = {"µ": "u", "×": "x", "–": "-", "—": "-", "−": "-", "…": "...", "≥": ">=", "≤": "<=", "·": "*", "°": " deg"}
"""Letters of ours that ASCII has no like of, and what they become."""


def console(least: int) -> "Console":
    """What prints tables on stdout, as wide as the terminal, and `least` columns where it is narrower."""
    from rich.console import Console

    return Console(width=max(Console().width or UNKNOWN, least))


class NoOutput(Exception):
    """What a command prints cannot be written; `reason` says why."""

    def __init__(self, reason: OSError) -> None:
        super().__init__(str(reason))
        self.reason = reason


class Guarded:
    """A text stream that has an answer to each failure of the one below it.

    Args:
        stream: to write to.
        needed: without stdout a command has no purpose, and `NoOutput` is raised; without stderr it goes on in silence.
    """

    def __init__(self, stream: TextIO, *, needed: bool) -> None:
        self._stream, self._needed = stream, needed

    def write(self, text: str) -> int:
        """Write as any stream does."""
        try:
            return self._stream.write(text)
        except (OSError, ValueError) as error:
            self._failed(error)
            return len(text)

    def flush(self) -> None:
        """Flush as any stream does."""
        try:
            self._stream.flush()
        except (OSError, ValueError) as error:
            self._failed(error)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _failed(self, error: OSError | ValueError) -> None:
        if not isinstance(error, OSError) and not self._stream.closed:
            raise error
        _to_nowhere(self._stream)
        if self._needed:
            raise NoOutput(error if isinstance(error, OSError) else BrokenPipeError()) from error


@contextmanager
def guarded_streams() -> Generator[None]:
    """Guard stdout and stderr, and print letters that they do not have as similar ones, while the `with` lasts."""
    codecs.register_error("evimo", _similar)
    before = sys.stdout, sys.stderr
    out, err = (_opened(stream) for stream in before)
    sys.stdout, sys.stderr = Guarded(out, needed=True), Guarded(err, needed=False)  # type: ignore[assignment]
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def _opened(stream: TextIO | None) -> TextIO:
    """The stream, or, where the caller closed it, one into nothing."""
    if stream is None:
        return open(os.devnull, "w", encoding="utf-8")
    reconfigure = getattr(stream, "reconfigure", None)
    if reconfigure is not None:
        reconfigure(errors="evimo")
    return stream


def _to_nowhere(stream: TextIO) -> None:
    """Let what is still in its buffer go to nothing: Python writes it when it ends, and would complain once more."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def _similar(error: UnicodeError) -> tuple[str, int]:
    """How letters that an encoding lacks are written."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = "".join(_plain(letter) for letter in error.object[error.start : error.end])
    return text, error.end


def _plain(letter: str) -> str:
    without_accents = unicodedata.normalize("NFKD", letter).encode("ascii", "ignore").decode()
    return PLAIN.get(letter) or without_accents or "?"
