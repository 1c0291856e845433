"""Jobs done by a crew: the one way in which commands work on many recordings."""

import warnings
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Protocol, TypeVar

from evimo.errors import BadFile, EvimoError, EvimoWarning, NotFound
from evimo.jobs.crew import Crew, cores
from evimo.jobs.outcome import Outcome, outcome_of
from evimo.jobs.processes import Processes, packed

Job = TypeVar("Job")
Result = TypeVar("Result")
SAID = 3  # failures that the error quotes, recordings that a warning names


class Pending(Protocol):
    """An outcome that is to come."""

    def add_done_callback(self, fn: Callable[[Any], Any], /) -> Any:
        """Have it handed over when it has come."""
        ...

    def result(self) -> Any:
        """The outcome."""
        ...


def finished(
    work: Callable[[Job], Result], jobs: Iterable[Job], *, crew: Crew, shared: Path, name: Callable[[Job], object]
) -> Iterator[Result]:
    """Yield what `work` returns, as jobs finish; in order where this process works alone.

    A job whose process or machine dies is done again. Where the caller stops early or this process dies, jobs that
    have not begun are dropped and those under way are broken off; they clean up after themselves. One that finds a
    file missing or broken costs its own result, and the error comes after all others; any other error ends all. What
    many recordings warn of is told of the first three, and how many more there were at the end.

    Args:
        work: a function of some module, or a `partial` of one. It writes files, and returns at once where they are
            there already: a machine may die, or be lost sight of, after its work is done.
        jobs: one for each recording.
        crew: who does them.
        shared: a folder that all see; the files belong in it.
        name: of the recording of a job, for errors and warnings.

    Raises:
        BadInput, MissingExtra, NotFound: what `Crew.check` says, or there is no such cluster.
        EvimoError: of a job.
    """
    crew.check()
    jobs, failures, warned = list(jobs), list[EvimoError](), Counter[str]()
    for job, outcome in _outcomes(work, jobs, crew, shared):
        _warn(name(job), outcome.warnings, warned)
        error = outcome.error
        if isinstance(error, EvimoError):
            error = type(error)(_named(name(job), error.problem), fix=error.fix)
        if isinstance(error, NotFound | BadFile):
            failures.append(error)
        elif error is not None:
            raise error
        else:
            yield outcome.result
    _warn_of_more(warned)
    if failures:
        raise _together(failures, len(jobs))


def _warn(name: object, problems: Iterable[str], warned: Counter[str]) -> None:
    """Warn of what only few had so far, and count it by recordings."""
    for problem in problems:
        if warned[problem] < SAID:
            warnings.warn(_named(name, problem), EvimoWarning, stacklevel=3)
        warned[problem] += 1


def _warn_of_more(warned: Counter[str]) -> None:
    """Warn of how many more recordings had what the first ones had."""
    for problem, recordings in warned.items():
        if recordings > SAID:
            warnings.warn(EvimoWarning(f"{recordings - SAID} more recordings: {problem}"), stacklevel=3)


def _outcomes(
    work: Callable[[Job], Any], jobs: Sequence[Job], crew: Crew, shared: Path
) -> Generator[tuple[Job, Outcome]]:
    """Each job with what came of it, as they finish."""
    if crew.is_alone:
        yield from ((job, outcome_of(work, job)) for job in jobs)
        return
    if not jobs:
        return
    if crew.dask is None:
        hired = _hired(crew.workers)
    else:
        from evimo.jobs.cluster import connected

        hired = connected(crew.dask, shared)
    with hired as submit:
        ended: SimpleQueue[tuple[Job, Pending]] = SimpleQueue()
        for job in jobs:
            submit(packed(work, job)).add_done_callback(partial(_tell, ended, job))
        for _ in jobs:
            job, pending = ended.get()
            yield job, pending.result()


def _tell(ended: "SimpleQueue[tuple[Job, Pending]]", job: Job, pending: Pending) -> None:
    ended.put((job, pending))


@contextmanager
def _hired(workers: int) -> Generator[Callable[[bytes], Pending]]:
    """Processes of this machine, which share its cores; what takes a job for them."""
    processes, pool = Processes(threads=max(1, cores() // workers)), ThreadPoolExecutor(workers)
    try:
        yield partial(pool.submit, processes.outcome)
    finally:
        processes.close()
        pool.shutdown(cancel_futures=True)


def _named(name: object, problem: str) -> str:
    """What is wrong, with the name of the recording where that is not told."""
    return problem if str(name) in problem else f"{name}: {problem}"


def _together(failures: Sequence[EvimoError], count: int) -> EvimoError:
    """One error of several."""
    if len(failures) == 1:
        return failures[0]
    problems = list(dict.fromkeys(failure.problem for failure in failures))  # jobs may read the same broken file
    told = problems[:SAID] + ([f"and {len(problems) - SAID} more"] if len(problems) > SAID else [])
    return EvimoError(f"{len(failures)} of {count} failed: {'; '.join(told)}", fix=failures[0].fix)
