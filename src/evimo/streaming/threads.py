"""Stages of the pipeline in threads of their own, joined by bounded queues: constant memory at any length."""

from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
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
    enough = Event()

    def fill() -> None:
        failure = None
        try:
            for item in items:
                queue.put(item)
                if enough.is_set():
                    break
        except BaseException as error:  # carried over to the thread that reads
            failure = error
        finally:
            if isinstance(items, GeneratorType):
                items.close()
            queue.put(_End(failure))

    thread = Thread(target=fill, daemon=True)
    thread.start()
    try:
        while not isinstance(item := queue.get(), _End):
            yield item
        if item.failure is not None:
            raise item.failure
    finally:
        enough.set()
        while thread.is_alive():  # it may wait to put: make room until it has seen that it is over
            with suppress(Empty):
                queue.get(timeout=PATIENCE_S)
        thread.join()


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
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    finally:
        pool.shutdown(cancel_futures=True)
        items.close()


class Background(Generic[T]):
    """Calls `work(item)` for each item in a thread of its own, in order, at most `depth` behind.

    What `work` raises is raised by the next `put` or by `close`.
    """

    def __init__(self, work: Callable[[T], None], *, depth: int = 8) -> None:
        self._work = work
        self._queue: Queue[T | _End] = Queue(depth)
        self._failure: BaseException | None = None
        self._enough = Event()
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
            if self._thread.is_alive():
                self._hand_over(_End())
            self._thread.join()
        except BaseException:
            self._enough.set()
            with suppress(Full):  # there is something in it that ends the thread as well
                self._queue.put_nowait(_End())
            self._thread.join()
            raise
        self._raise_failure()

    def _hand_over(self, item: T | _End) -> None:
        while True:
            self._raise_failure()
            with suppress(Full):
                self._queue.put(item, timeout=PATIENCE_S * 10)
                return

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
