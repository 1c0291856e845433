"""Where the time goes: exclusive wall time of each stage, over several threads."""

import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

T = TypeVar("T")


class Stopwatch:
    """Wall time by stage, in seconds. A stage inside another one is taken off it; threads run side by side.

    A stage that runs in several threads at once counts the time of each.
    """

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        self._clock = clock
        self.seconds: dict[str, float] = {}
        self._running = threading.local()
        self._lock = threading.Lock()

    @contextmanager
    def stage(self, name: str) -> Generator[None]:
        """Count the time inside the `with` as `name`."""
        outer: float = getattr(self._running, "inner_s", 0.0)
        self._running.inner_s, start = 0.0, self._clock()
        try:
            yield
        finally:
            elapsed = self._clock() - start
            with self._lock:
                self.seconds[name] = self.seconds.get(name, 0.0) + elapsed - self._running.inner_s
            self._running.inner_s = outer + elapsed

    def over(self, name: str, items: Iterable[T]) -> Iterator[T]:
        """The same items; the time that making each takes is counted as `name`."""
        iterator = iter(items)
        while True:
            with self.stage(name):
                try:
                    item = next(iterator)
                except StopIteration:
                    return
            yield item

    def mean_ms(self, count: int) -> dict[str, float]:
        """Milliseconds of each stage per item, of `count` items."""
        return {name: round(1e3 * seconds / max(count, 1), 3) for name, seconds in self.seconds.items()}
