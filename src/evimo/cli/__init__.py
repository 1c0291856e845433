"""The commands of `evimo`: one file each that parses, calls the library and prints.

Each is imported when it is called, so that `evimo --help` is fast and running needs no part of training.
"""

import sys
import warnings
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from typing import TextIO

from cyclopts import App, CycloptsError

from evimo.cli.exit_codes import INTERRUPTED, WRONG_INPUT
from evimo.errors import EvimoError, EvimoWarning

COMMANDS = {
    "run": "Find moving objects, depth and motion in a recording.",
    "info": "Say what is in a recording.",
    "view": "Show a recording as a video, with its truth where that is known.",
    "simulate": "Make recordings with exact truth.",
    "train": "Train a model on recordings with truth.",
    "evaluate": "Score a model on recordings with truth.",
    "realism": "Compare simulated events with real ones.",
}


def app(wanted: str = "") -> App:
    """The parser of all commands; `wanted` explains itself by its whole docstring, the others by one line, unloaded."""
    about = "Moving objects, depth and motion from an event camera."
    parser = App(name="evimo", help=about, version=_version, suppress_keyboard_interrupt=False)
    for name, summary in COMMANDS.items():
        parser.command(f"evimo.cli.{name}:{name}", name=name, help=None if name == wanted else summary)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code: 0, 2 for what the user can fix, 130 after Ctrl-C.

    Args:
        arguments: as after the program's name; None takes those of the process.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        with _warnings_in_one_line():
            code = app(*arguments[:1])(arguments, exit_on_error=False, result_action="return_value")
    except CycloptsError:  # it has printed what is wrong with the arguments
        return WRONG_INPUT
    except EvimoError as error:
        print(f"error: {error}", file=sys.stderr)
        return WRONG_INPUT
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return INTERRUPTED
    return code if isinstance(code, int) else 0


@contextmanager
def _warnings_in_one_line() -> Generator[None]:
    """Print each of our warnings once, as one line; the others as Python does."""
    said: set[str] = set()
    usual = warnings.showwarning

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        if not issubclass(category, EvimoWarning):
            usual(message, category, filename, lineno, file, line)
        elif str(message) not in said:
            said.add(str(message))
            print(f"warning: {message}", file=sys.stderr)

    with warnings.catch_warnings():
        warnings.simplefilter("always", EvimoWarning)
        warnings.showwarning = show
        yield


def _version() -> str:
    return version("evimo")
