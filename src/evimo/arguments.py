"""Arguments of public functions, checked where they come in: what a type checker says of them, to those without one."""

from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Any, cast

from evimo.errors import BadInput, NotFound

MOST_PIXELS = 1 << 25  # of a sensor: several times as many as the largest event camera has
SIZE = "(height, width) in whole pixels, as in (260, 346)"


def path_of(given: object, what: str) -> Path:
    """Return what was given as a path.

    Args:
        given: a `str` or a `Path`.
        what: it is the path of, for the error.

    Raises:
        BadInput: it is something else. NotFound: the system takes no such path.
    """
    if not isinstance(given, str | PathLike):
        raise BadInput(f"{what} is given as {_kind(given)}", fix="a path, as str or pathlib.Path")
    path = Path(cast("str | PathLike[str]", given))
    try:
        path.exists()
    except OSError as error:
        raise NotFound(f"{what} cannot be looked for: {error.strerror}", fix="check the path") from error
    return path


def paths_of(given: object, what: str) -> list[Path]:
    """Return one path, or several, as a list.

    Raises:
        BadInput, NotFound: as `path_of`.
    """
    several = isinstance(given, Iterable) and not isinstance(given, str | bytes | PathLike)
    return [path_of(each, what) for each in (cast("Iterable[object]", given) if several else [given])]


def size_of(given: Any, what: str) -> tuple[int, int]:
    """Return the size of a sensor as whole numbers, from any two that are whole.

    Raises:
        BadInput: they are not two, not whole, below 1, or more than a sensor has.
    """
    try:
        numbers = [] if isinstance(given, str | bytes) else [float(each) for each in given]
    except (TypeError, ValueError, OverflowError):
        numbers = []
    if len(numbers) != 2 or not all(1 <= each <= MOST_PIXELS and each.is_integer() for each in numbers):
        raise BadInput(f"{what} is {_shown(given)}, which is no size", fix=SIZE)
    height, width = map(int, numbers)
    if height * width > MOST_PIXELS:
        raise BadInput(f"{what} is {height} rows of {width} pixels: no event camera has so many", fix=SIZE)
    return height, width


def number_of(given: Any, what: str, *, fix: str) -> float:
    """Return what was given as a number.

    Raises:
        BadInput: it is none.
    """
    try:
        return float(given)
    except (TypeError, ValueError, OverflowError):
        raise BadInput(f"{what} is {_shown(given)}, which is no number", fix=fix) from None


def word_of(given: object, what: str, *, fix: str) -> str:
    """Return what was given as a word.

    Raises:
        BadInput: it is something else than a `str`.
    """
    if not isinstance(given, str):
        raise BadInput(f"{what} is {_shown(given)}, which is no word", fix=fix)
    return given


def _kind(given: object) -> str:
    return "nothing (None)" if given is None else f"a value of type {type(given).__name__}"


def _shown(given: object) -> str:
    """The value, if it is short."""
    text = " ".join(repr(given).split())
    return text if len(text) <= 60 else _kind(given)
