"""What the user can fix: errors that say how, and the one kind of warning."""

from functools import partial
from typing import Any


class EvimoError(Exception):
    """The user can fix this; the message says how."""

    def __init__(self, problem: str, *, fix: str) -> None:
        super().__init__(f"{problem}\n  try: {fix}")
        self.problem = problem
        self.fix = fix

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


class EvimoWarning(UserWarning):
    """Something in the input was left out or guessed; the message gives counts."""
