"""Which camera's events are read, of a file that holds those of several."""

import warnings
from collections.abc import Sequence
from pathlib import Path

from evimo.errors import EvimoWarning, NotFound

MOST_NAMES = 8  # that are listed


def listed(names: Sequence[str]) -> str:
    """Names in a row; of many the first ones, and how many others there are."""
    more = f" and {len(names) - MOST_NAMES:,} others" if len(names) > MOST_NAMES else ""
    return ", ".join(names[:MOST_NAMES]) + more


def chosen_of(path: Path, names: Sequence[str], topic: str | None) -> int:
    """The place among names of that which `topic` names, whole or by a word or part; else the first, with a warning.

    The warning says what else there is.

    Raises:
        NotFound: none fits, or several.
    """
    if topic is not None:
        wanted = topic.strip("/")
        fitting = (
            [name for name in names if name.strip("/") == wanted]
            or [name for name in names if wanted in name.split("/")]
            or [name for name in names if wanted in name]
        )
        if len(fitting) != 1:
            problem = f"{len(fitting)} events in {path.name} fit" if fitting else f"{path.name} holds no events"
            raise NotFound(f"{problem} --topic {topic}", fix=f"one of: {listed(names)}")
        return names.index(fitting[0])
    if len(names) > 1:
        text = f"{path.name} holds events of several cameras: {listed(names)}; {names[0]} is read, --topic chooses"
        warnings.warn(text, EvimoWarning, stacklevel=5)
    return 0
