"""Progress on stderr: a bar on a terminal, a line now and then elsewhere."""

import sys
import time
from collections.abc import Generator
from contextlib import contextmanager
from typing import Protocol

EVERY_S = 10.0  # between lines where there is no terminal


class Advance(Protocol):
    """Called once for each finished slice."""

    def __call__(self) -> None:
        """One more slice is done."""
        ...


@contextmanager
def progress(total: int) -> Generator[Advance]:
    """Show slices/s and the time left of `total` slices while the `with` lasts."""
    if not sys.stderr.isatty():
        yield _lines(total)
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[speed]}"), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task, rate = bar.add_task("slices", total=total, speed=""), _Rate()

        def advance() -> None:
            rate.add()
            bar.update(task, advance=1, speed=f"{rate.per_s:.0f} slices/s")

        yield advance


class _Rate:
    """Finished slices over the time since the first one."""

    def __init__(self) -> None:
        self.count, self._first_s = 0, 0.0

    def add(self) -> None:
        self._first_s = self._first_s or time.perf_counter()
        self.count += 1

    @property
    def per_s(self) -> float:
        return (self.count - 1) / max(time.perf_counter() - self._first_s, 1e-9)


def _lines(total: int) -> Advance:
    rate, said_s = _Rate(), time.perf_counter()

    def advance() -> None:
        nonlocal said_s
        rate.add()
        if rate.count > 1 and time.perf_counter() - said_s >= EVERY_S:
            said_s, per_s = time.perf_counter(), rate.per_s
            left_s = (total - rate.count) / per_s
            print(f"{rate.count} of {total} slices, {per_s:.1f} slices/s, {left_s:.0f} s left", file=sys.stderr)

    return advance
