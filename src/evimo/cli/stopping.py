"""Ctrl-C, SIGTERM and SIGHUP: each ends a command as Ctrl-C does, and some commands finish what they are at before.

Signals come several at a time: a key is pressed twice, a terminal that closes and a supervisor tell a whole group.
Those that follow one that breaks off are passed over for a while, as they would break off the cleaning up.
"""

import signal
import sys
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

from evimo.cli.exit_codes import BY_SIGNAL

NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")  # Windows has no SIGHUP, and others no SIGBREAK
PAUSE_S = 3.0  # a cleaning up that takes longer can be broken off too
Handler = Callable[[int, FrameType | None], Any]


_broken_off: list[tuple[float, int]] = []  # when, and by which signal


class Stopped(KeyboardInterrupt):
    """A signal asked the command to end."""

    def __init__(self, number: int = signal.SIGINT) -> None:
        super().__init__(number)
        self.number = number

    @property
    def code(self) -> int:
        """The exit code that says so."""
        return BY_SIGNAL + self.number

    def __str__(self) -> str:
        return "interrupted" if self.number == signal.SIGINT else f"ended by {signal.Signals(self.number).name}"


class Request:
    """Whether a signal has asked to stop; true from then on.

    number: of the signal, 0 before.
    """

    def __init__(self) -> None:
        self.number = 0

    def __bool__(self) -> bool:
        return bool(self.number)


@contextmanager
def stopped_by_signals() -> Generator[None]:
    """Raise `Stopped` where a signal arrives, while the `with` lasts, and in place of whatever else comes of that."""

    def stop(number: int, frame: FrameType | None) -> None:
        _break_off(number)

    try:
        with _handled(stop):
            yield
    except BaseException:
        raise_if_broken_off()
        raise
    finally:
        _broken_off.clear()


@contextmanager
def asked_to_stop(unit: str, told: Callable[[], None] = lambda: None) -> Generator[Request]:
    """A request that the first signal makes, to stop after this `unit`; the second one breaks off.

    told: called at once with the first.
    """
    raise_if_broken_off()
    request = Request()

    def ask(number: int, frame: FrameType | None) -> None:
        if request:
            _break_off(number)
            return
        request.number = number
        told()
        with suppress(RuntimeError):  # in the middle of another line: Python does not write one in the other
            print(f"stopping after this {unit}; Ctrl-C again to give up", file=sys.stderr)

    with _handled(ask):
        yield request


def raise_if_broken_off() -> None:
    """Raise `Stopped` once more where a signal has broken off the command: some libraries catch whatever is raised."""
    if _broken_off:
        raise Stopped(_broken_off[-1][1])


def _break_off(number: int) -> None:
    """Raise `Stopped`, unless that has just been done."""
    now_s = time.monotonic()
    if not _broken_off or now_s - _broken_off[-1][0] > PAUSE_S:
        _broken_off.append((now_s, number))
        raise Stopped(number)


@contextmanager
def _handled(handler: Handler) -> Generator[None]:
    """What is ignored, as under nohup, stays ignored; outside the main thread nothing is handled."""
    before: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():
        for name in NAMES:
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, handler)
    try:
        yield
    finally:
        for number, usual in before.items():
            signal.signal(number, usual)
