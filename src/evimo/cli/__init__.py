"""The commands of `evimo`: one file each that parses, calls the library and prints.

Each is imported when it is called, so that `evimo --help` is fast and running needs no part of training.
"""

import sys
import warnings
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from typing import Any, TextIO

from cyclopts import App, CycloptsError

from evimo.cli.boundary import outcome
from evimo.cli.streams import console
from evimo.compiling import announced
from evimo.errors import BadInput, EvimoWarning, in_one_line

NARROWEST = 20  # columns of an explanation
COMMANDS = {
    "run": "Find moving objects, depth and motion in a recording.",
    "info": "Say what is in a recording.",
    "check": "Look for defects in a recording.",
    "convert": "Write recordings with truth in another layout.",
    "download": "Fetch EV-IMO, and go on where it stopped.",
    "view": "Look at a recording, run or capture: in a window, a browser or a video.",
    "simulate": "Make recordings with exact truth.",
    "annotate": "Make the truth of a capture from motion capture and scans.",
    "train": "Train a model on recordings with truth.",
    "evaluate": "Score a model on recordings with truth.",
    "benchmark": "Repeat the paper's experiments, and write their tables and a page.",
    "locate-markers": "Find the markers of motion capture in scans.",
    "calibrate": "Find where a camera sits on its tracked rig, its lens and its clock.",
    "align-room": "Put fragments of a scanned room together.",
    "realism": "Compare simulated events with real ones.",
}


def app(wanted: str = "") -> App:
    """The parser of all commands; `wanted` explains itself by its whole docstring, the others by one line, unloaded."""
    about = "Moving objects, depth and motion from an event camera."
    parser = App(name="evimo", help=about, version=_version, suppress_keyboard_interrupt=False)
    parser.console = console(NARROWEST)
    for name, summary in COMMANDS.items():
        function = name.replace("-", "_")
        parser.command(f"evimo.cli.{function}:{function}", name=name, help=None if name == wanted else summary)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code: 0; one of cli/exit_codes.py; 128 + n after signal n.

    Args:
        arguments: as after the program's name; None takes those of the process.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    out: list[object] = []  # where the command writes

    def command() -> object:
        with _warnings_in_one_line(), announced(_say):
            function, bound, _ = _parsed(arguments)
            out.append(bound.arguments.get("out") or bound.arguments.get("save"))
            return function(*bound.args, **bound.kwargs)

    return outcome(command, place=lambda: out[0] if out else None)


def _parsed(arguments: Sequence[str]) -> Any:
    """The function to call and its arguments.

    Raises:
        BadInput: they are wrong.
    """
    try:
        return app(*arguments[:1]).parse_args(arguments, exit_on_error=False, print_error=False)
    except CycloptsError as error:
        error.verbose = False
        known = arguments[0] if arguments and arguments[0] in COMMANDS else ""
        problem = " ".join(str(error).split())
        raise BadInput(problem.rstrip("."), fix=f"evimo {known}{' ' if known else ''}--help") from error


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
            _say(f"warning: {in_one_line(str(message))}")

    with warnings.catch_warnings():
        warnings.simplefilter("always", EvimoWarning)
        warnings.showwarning = show
        yield


def _say(line: str) -> None:
    print(line, file=sys.stderr)


def _version() -> str:
    return version("evimo")
