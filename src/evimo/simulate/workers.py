"""Work on recordings in one process or several."""

import signal
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import TypeVar

import numba

from evimo.errors import BadInput

Job = TypeVar("Job")
Result = TypeVar("Result")


def finished(work: Callable[[Job], Result], jobs: Iterable[Job], workers: int) -> Iterator[Result]:
    """What `work` returns, as jobs finish; in order with one worker, which is this process.

    Where the caller stops early, jobs that have not begun are dropped and those under way are waited for.

    Raises:
        BadInput: less than one worker.
    """
    check_workers(workers)
    if workers == 1:
        yield from map(work, jobs)
        return
    context = get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_prepare, initargs=(workers,)) as pool:
        futures = [pool.submit(work, job) for job in jobs]
        try:
            for future in as_completed(futures):
                yield future.result()
        finally:
            pool.shutdown(cancel_futures=True)


def check_workers(workers: int) -> None:
    """Make sure that there is somebody to do the work.

    Raises:
        BadInput: less than one worker.
    """
    if workers < 1:
        raise BadInput(f"{workers} workers", fix="at least one")


def _prepare(workers: int) -> None:
    """Share the cores; leave Ctrl-C to the parent, which then waits for what is under way."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    numba.set_num_threads(max(1, numba.get_num_threads() // workers))
