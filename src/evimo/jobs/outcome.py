"""One job done: what came of it, an error included, and what was warned of."""

import pickle
import traceback
import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

from evimo.errors import EvimoWarning


class Outcome(NamedTuple):
    """What came of a job: its result, or its error, and our warnings."""

    result: Any = None
    error: Exception | None = None
    warnings: tuple[str, ...] = ()


def outcome_of(work: Callable[[Any], Any], job: Any) -> Outcome:
    """Do a job, and return what came of it; warnings that are not ours are shown as always."""
    result = error = None
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", EvimoWarning)
        try:
            result = work(job)
        except Exception as failure:
            error = failure
    for each in caught:
        if not issubclass(each.category, EvimoWarning):
            warnings.showwarning(each.message, each.category, each.filename, each.lineno)
    ours = [str(each.message) for each in caught if issubclass(each.category, EvimoWarning)]
    return Outcome(result, error, tuple(dict.fromkeys(ours)))


def as_bytes(outcome: Outcome) -> bytes:
    """An outcome on its way to another process, which could not see the traceback of an error otherwise."""
    if outcome.error is not None:
        trace = "".join(traceback.format_exception(outcome.error))
        outcome.error.add_note(f"in another process:\n{trace}")
        outcome = outcome._replace(error=_portable(outcome.error, trace))
    return pickle.dumps(outcome)


def _portable(error: Exception, trace: str) -> Exception:
    """An error that arrives: the same, unless it cannot be packed and unpacked."""
    try:
        return pickle.loads(pickle.dumps(error))
    except Exception:  # whatever the error's own packing raises: what it was is in its traceback, which arrives
        return RuntimeError(trace)
