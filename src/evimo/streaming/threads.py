"""Stages of the pipeline in threads of their own, joined by bounded queues: constant memory at any length.

A signal may break off any wait. Whatever waits for a thread to end waits once more then: compiled code that still works
when its memory is given back, or when Python ends, takes the process with it. Waits are for events and futures, since
`Thread.join`, once broken off, takes a thread for ended that is not, up to Python 3.12.
"""

from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import closing, nullcontext, suppress
from queue import Empty, Full, Queue
from threading import Event, Thread
from types import GeneratorType
from typing import Generic, TypeVar

T = TypeVar("T")
R = TypeVar("R")

PATIENCE_S = 0.05  # how often a side that waits on a queue looks whether the other one has given up


class _End:
    """The last thing in a queue: the items are at their end, or their maker failed."""

    def __init__(self, failure: BaseException | None = None) -> None:
        self.failure = failure


def ahead(items: Iterable[T], *, depth: int = 2) -> Generator[T]:
    """The same items, made up to `depth` in advance by another thread.

    What the maker raises is raised here, after the items before it. Closing this generator ends the thread and closes
    `items` in it.
    """
    queue: Queue[T | _End] = Queue(depth)
    enough, over = Event(), Event()

    def fill() -> None:
        failure = None
        try:
            with closing(items) if isinstance(items, GeneratorType) else nullcontext():
                for item in items:
                    queue.put(item)
                    if enough.is_set():
                        break
        except BaseException as error:  # carried over to the thread that reads
            failure = error
        queue.put(_End(failure))
        over.set()

    def end() -> None:
        enough.set()
        # The thread, if it has begun, may wait to put: make room until it has seen that it is over.
        while thread.ident is not None and not over.is_set():
            with suppress(Empty):
                queue.get(timeout=PATIENCE_S)

    thread = Thread(target=fill, daemon=True)
    try:
        thread.start()
        while not isinstance(item := queue.get(), _End):
            yield item
        if item.failure is not None:
            raise item.failure
    finally:
        _surely(end)
        if over.is_set():
            thread.join()  # whose work is over


def in_parallel(work: Callable[[T], R], items: Generator[T], *, workers: int) -> Generator[R]:
    """`work(item)` of each item in order, by several threads; at most `workers` + 2 items are in use at once.

    What `work` raises is raised here, in the place of its result. Closing this generator waits for the work that runs
    and closes `items`.
    """
    pool, waiting = ThreadPoolExecutor(workers), deque[Future[R]]()
    try:
        for item in items:
            waiting.append(pool.submit(work, item))
            if len(waiting) > workers:
                yield waiting[0].result()
                waiting.popleft()
        while waiting:
            yield waiting[0].result()
            waiting.popleft()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        _surely(lambda: wait([each for each in waiting if not each.cancelled()]))
        pool.shutdown()  # whose threads have nothing left to do
        items.close()


def _surely(end: Callable[[], object]) -> None:
    """Call it, and once more where a signal breaks it off."""
    try:
        end()
    except BaseException:
        end()
        raise


class Background(Generic[T]):
    """Calls `work(item)` for each item in a thread of its own, in order, at most `depth` behind.

    What `work` raises is raised by the next `put` or by `close`.
    """

    def __init__(self, work: Callable[[T], None], *, depth: int = 8) -> None:
        self._work = work
        self._queue: Queue[T | _End] = Queue(depth)
        self._failure: BaseException | None = None
        self._enough, self._over = Event(), Event()
        self._thread = Thread(target=self._loop, daemon=True)
        self._thread.start()

    def put(self, item: T) -> None:
        """Hand over one item; waits while `depth` items are unfinished."""
        self._hand_over(item)

    def close(self) -> None:
        """Wait until every item is done; if a signal breaks that off, until the one is done that is under way.

        However it ends, nothing works on any more: what `work` writes to may be closed.
        """
        try:
            if not self._over.is_set():
                self._hand_over(_End())
            self._over.wait()
        except BaseException:
            self._enough.set()
            with suppress(Full):  # there is something in it that ends the thread as well
                self._queue.put_nowait(_End())
            self._over.wait()
            raise
        self._thread.join()
        self._raise_failure()

    def _hand_over(self, item: T | _End) -> None:
        self._raise_failure()
        while not self._over.is_set():  # its failure may have been raised before, with the queue still full
            with suppress(Full):
                self._queue.put(item, timeout=PATIENCE_S * 10)
                return
        self._raise_failure()

    def _raise_failure(self) -> None:
        if self._failure is not None:
            failure, self._failure = self._failure, None
            raise failure

    def _loop(self) -> None:
        try:
            while not isinstance(item := self._queue.get(), _End) and not self._enough.is_set():
                self._work(item)
        except BaseException as error:  # carried over to the thread that puts
            self._failure = error
        finally:
            self._over.set()
