"""Work on recordings in one process or several."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import TypeVar

import numba

from evimo.errors import BadInput, EvimoError
from evimo.simulate.lifeline import at_work, hang_on

Job = TypeVar("Job")
Result = TypeVar("Result")


def finished(work: Callable[[Job], Result], jobs: Iterable[Job], workers: int) -> Iterator[Result]:
    """What `work` returns, as jobs finish; in order with one worker, which is this process.

    Where the caller stops early, jobs that have not begun are dropped and those under way are broken off; they clean
    up after themselves. So it is where this process dies.

    Raises:
        BadInput: less than one worker. EvimoError: a worker was ended from outside.
    """
    check_workers(workers)
    if workers == 1:
        yield from map(work, jobs)
        return
    context = get_context("spawn")
    theirs, ours = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_prepare, initargs=(workers, theirs))
    try:
        futures = [pool.submit(partial(_worked, work), job) for job in jobs]
        for future in as_completed(futures):
            yield future.result()
    except BrokenProcessPool as error:
        problem = "a process that simulates was ended from outside, perhaps for want of memory"
        raise EvimoError(problem, fix="the same command again, with fewer --workers") from error
    finally:
        ours.close()  # breaks off what is under way
        pool.shutdown(cancel_futures=True)
        theirs.close()


def check_workers(workers: int) -> None:
    """Make sure that there is somebody to do the work.

    Raises:
        BadInput: less than one worker.
    """
    if workers < 1:
        raise BadInput(f"{workers} workers", fix="at least one")


def _prepare(workers: int, line: Connection) -> None:
    """Share the cores; end with the parent."""
    hang_on(line)
    numba.set_num_threads(max(1, numba.get_num_threads() // workers))


def _worked(work: Callable[[Job], Result], job: Job) -> Result:
    with at_work():
        return work(job)
