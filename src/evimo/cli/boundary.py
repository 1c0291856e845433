"""The one place where commands end: whatever happens becomes an exit code and at most two lines.

Only a bug of ours keeps its traceback.
"""

import errno
import sys
import traceback
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version

from evimo.cli.exit_codes import BUG, WRONG_INPUT
from evimo.cli.stopping import Stopped, stopped_by_signals
from evimo.cli.streams import NoOutput, guarded_streams
from evimo.errors import EvimoError, in_one_line

FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
FORBIDDEN = {errno.EACCES, errno.EPERM, errno.EROFS}
FIXES = {
    **dict.fromkeys(FULL, "more room on the disk, or another folder"),
    **dict.fromkeys(FORBIDDEN, "a folder that may be written, or other permissions"),
    **dict.fromkeys((errno.EMFILE, errno.ENFILE), "a higher limit of open files: ulimit -n 4096"),
}
OTHER_FIX = "look whether the disk is still there, and can be read and written"


def outcome(command: Callable[[], object], *, place: Callable[[], object] = lambda: None) -> int:
    """Do something, say in a line what went wrong, and return the exit code.

    Args:
        command: may return its exit code; anything else is 0.
        place: what to name where the system does not tell which file it could not write.
    """
    with guarded_streams():
        try:
            with stopped_by_signals():
                code = command()
                sys.stdout.flush()
        except BaseException as error:
            return _told(error, place)
        return code if isinstance(code, int) else 0


def _told(error: BaseException, place: Callable[[], object]) -> int:
    """Print what happened, and return the exit code of it."""
    match error:
        case EvimoError():
            _say(f"error: {error}")
        case NoOutput():
            if not isinstance(error.reason, BrokenPipeError):  # of `| head`, the user knows
                _say(f"error: cannot print: {error.reason.strerror}\n  try: another place for what the command prints")
        case KeyboardInterrupt():
            stopped = error if isinstance(error, Stopped) else Stopped()
            _say(str(stopped))
            return stopped.code
        case RuntimeError() if "can't start new thread" in str(error):
            _say("error: no more threads may be started\n  try: fewer --workers, or a higher limit: ulimit -u")
        case MemoryError():
            _say("error: not enough memory\n  try: a shorter part, fewer --workers, or a machine with more of it")
        case OSError() if (problem := _of_system(error, place)) is not None:
            _say(f"error: {problem}")
        case _:
            return _bug(error)
    return WRONG_INPUT


def _of_system(error: OSError, place: Callable[[], object]) -> str | None:
    """What the system refused, and a fix; None if it was our mistake."""
    number = errno.ENOSPC if _is_short_write(error) else error.errno
    if number is None:
        return None
    reason = "No space left on device" if number == errno.ENOSPC else error.strerror
    where = in_one_line(str(error.filename2 or error.filename or place() or "a file"))
    wrong = "cannot write" if number in FULL else "cannot use"
    return f"{wrong} {where}: {reason}\n  try: {FIXES.get(number, OTHER_FIX)}"


def _is_short_write(error: OSError) -> bool:
    """NumPy says of a full disk how many items it wrote, and nothing else."""
    return error.errno is None and " requested and " in str(error) and str(error).endswith(" written")


def _bug(error: BaseException) -> int:
    if isinstance(error, SystemExit):
        raise error
    traceback.print_exception(error, file=sys.stderr)
    _say(f"this is a bug of evimo {_version()}: please report the command and the lines above where you got evimo from")
    return BUG


def _version() -> str:
    try:
        return version("evimo")
    except PackageNotFoundError:
        return "from a clone"


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
