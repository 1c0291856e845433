"""What the user can fix: errors that say how, and the one kind of warning."""

import json
import re
import sys
from functools import partial
from importlib.metadata import PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from urllib.request import url2pathname

CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]")
"""Letters of names that would begin a line of their own, or tell a terminal what to do."""


def in_one_line(text: str) -> str:
    """Return a text for a terminal: line breaks and other letters that steer it, as names may have them, as escapes."""
    return CONTROL.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


class EvimoError(Exception):
    """The user can fix this; the message says how."""

    def __init__(self, problem: str, *, fix: str) -> None:
        self.problem = in_one_line(problem)
        self.fix = in_one_line(fix)
        super().__init__(f"{self.problem}\n  try: {self.fix}")

    def __reduce__(self) -> tuple[Any, ...]:
        """How it comes back from a worker process."""
        return partial(type(self), fix=self.fix), (self.problem,)


class NotFound(EvimoError):
    """A file, a model or an object inside a file is not there."""


class BadFile(EvimoError):
    """A file is truncated, empty, of another format, or holds impossible values."""


class BadInput(EvimoError):
    """An argument is outside what it may be."""


class MissingExtra(EvimoError):
    """An optional part of the package is not installed."""

    def __init__(self, problem: str, *, extra: str = "", fix: str = "") -> None:
        """Say how to install the extra of that name, unless `fix` says something else."""
        super().__init__(problem, fix=fix or how_to_install(extra))


class EvimoWarning(UserWarning):
    """Something in the input was left out or guessed; the message gives counts."""


def check_installed(purpose: str, *modules: str, extra: str) -> None:
    """Make sure that modules of an extra can be imported.

    Raises:
        MissingExtra: one cannot; `purpose` needs it.
    """
    if missing := [module for module in modules if find_spec(module) is None]:
        raise MissingExtra(f"{purpose} needs {' and '.join(missing)}", extra=extra)


def how_to_install(extra: str) -> str:
    """The command that adds an extra such as `train`, from where this installation came from, to this environment."""
    pip, source, folder = f'"{sys.executable}" -m pip install', *_source()
    if folder is None:
        return f'{pip} "evimo[{extra}]{source}"'
    constraints = folder / "constraints.txt"
    pinned = f' -c "{constraints}"' if constraints.is_file() else ""
    return f'{pip}{pinned}{source} "{folder}[{extra}]"'


def _source() -> tuple[str, Path | None]:
    """What pip has to be told of where the package came from; and the folder that it was, if it still is there."""
    try:
        told = json.loads(distribution("evimo").read_text("direct_url.json") or "{}")
    except PackageNotFoundError:  # run from a clone that was never installed
        return " -e", Path(__file__).resolve().parents[2]
    url = told.get("url", "")
    if "vcs_info" in told:
        return f" @ {told['vcs_info']['vcs']}+{url}@{told['vcs_info']['commit_id']}", None
    path = Path(url2pathname(urlsplit(url).path)) if url.startswith("file:") else None
    if path is None or not path.exists():
        return f" @ {url}" if path is None and url else "", None
    if path.is_file():
        return f" @ {url}", None
    return (" -e" if told.get("dir_info", {}).get("editable") else ""), path
