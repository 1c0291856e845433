"""Progress on stderr: a bar on a terminal, a line now and then elsewhere; how much, how fast, and how long still."""

import os
import shutil
import sys
import time
from collections.abc import Generator
from contextlib import contextmanager
from typing import Protocol

from evimo.cli.stopping import raise_if_broken_off

EVERY_S = 10.0  # between lines where there is no terminal
SHORTEST_S = 0.5  # before a rate is worth saying
NARROW = 60  # columns, below which there is no room for a bar


class Advance(Protocol):
    """Called as work is finished."""

    def __call__(self, amount: float = 1, *, made: bool = True, facts: str = "") -> None:
        """Count more finished units; those that were there before are not `made`, and tell nothing of the pace."""
        ...


@contextmanager
def progress(total: float, unit: str = "slices", *, silent: bool = False) -> Generator[Advance]:
    """Show how many of `total` units are done, how many per second and the time left, while the `with` lasts."""
    pace = Pace(total, unit)
    if silent:
        yield lambda amount=1, *, made=True, facts="": None
        return
    if not _is_terminal():
        yield _lines(pace)
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn
    from rich.table import Column

    text = TextColumn("{task.description}", markup=False, table_column=Column(no_wrap=True, overflow="crop"))
    columns = (text,) if shutil.get_terminal_size().columns < NARROW else (BarColumn(), text)
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(pace.words(), total=total or None)

        def advance(amount: float = 1, *, made: bool = True, facts: str = "") -> None:
            pace.add(amount, made=made)
            bar.update(task, advance=amount, description=pace.words(facts))

        yield advance


class Pace:
    """Finished units, and those made here over the time since the first of them, which may have compiled."""

    def __init__(self, total: float, unit: str) -> None:
        self.total, self.unit = total, unit
        self.done, self._made, self._first_s = 0.0, 0.0, 0.0

    def add(self, amount: float, *, made: bool) -> None:
        """Count finished units; here a signal is heard that got lost before."""
        raise_if_broken_off()
        self.done += amount
        if made and not self._first_s:
            self._first_s = time.perf_counter()
        elif made:
            self._made += amount

    @property
    def per_s(self) -> float:
        """Units per second; 0 while that is not known."""
        elapsed_s = time.perf_counter() - self._first_s
        return self._made / elapsed_s if self._made and elapsed_s >= SHORTEST_S else 0.0

    def words(self, facts: str = "") -> str:
        """As `12 of 80 slices, 40.1 slices/s, 2 s left`."""
        words = [f"{_plainly(self.done)} of {_plainly(self.total)} {self.unit}"]
        if per_s := self.per_s:
            words.append(f"{_rate(per_s)} {self.unit}/s")
            if self.done < self.total:
                words.append(f"{_duration((self.total - self.done) / per_s)} left")
        return ", ".join([*words, facts] if facts else words)


def _plainly(amount: float) -> str:
    return f"{amount:.3f}".rstrip("0").rstrip(".")


def _rate(per_s: float) -> str:
    return f"{per_s:.1f}" if per_s >= 1 else f"{per_s:.2g}"


def _duration(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.0f} s"
    if seconds < 100 * 60:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h" if seconds < 100 * 3600 else f"{seconds / 86400:.0f} days"


def _is_terminal() -> bool:
    """Whether a bar can be drawn: not on a terminal that cannot move its cursor."""
    return sys.stderr.isatty() and os.environ.get("TERM", "") not in ("dumb", "unknown")


def _lines(pace: Pace) -> Advance:
    said_s = time.perf_counter()

    def advance(amount: float = 1, *, made: bool = True, facts: str = "") -> None:
        nonlocal said_s
        pace.add(amount, made=made)
        if pace.per_s and pace.done < pace.total and time.perf_counter() - said_s >= EVERY_S:
            said_s = time.perf_counter()
            print(pace.words(facts), file=sys.stderr)

    return advance
