"""Processes that end with the one that started them, however that ends, and leave nothing half-written."""

import _thread
import os
import signal
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

PARENTS = ("SIGINT", "SIGHUP", "SIGBREAK")
"""What a terminal sends to a whole group of processes, and the parent hears for all."""
PATIENCE_S = 20.0  # for what is under way to be cleaned up; a compiled function is not interrupted

_at_work = threading.Event()
_ending = threading.Event()


class Ended(SystemExit):
    """The process has to end: raised in the middle of its work, so that what is unfinished is removed."""


@contextmanager
def deaf_children() -> Generator[None]:
    """Let processes that are started while the `with` lasts be deaf to the signals that are the parent's to hear.

    Without it Ctrl-C would end them with a traceback while they import what they need, before they hang on.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _of_parents())
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def hang_on(wait: Callable[[], object]) -> None:
    """Make this process end soon after `wait` returns, or on SIGTERM.

    `wait` is called in a thread and must return when the parent is gone, as reading from a pipe does whose other end
    the parent alone holds. Other signals are the parent's to hear.
    """
    for number in _of_parents():
        signal.signal(number, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _of_parents())
    signal.signal(signal.SIGTERM, _end)
    end_after(wait)


def end_after(wait: Callable[[], object]) -> None:
    """Make this process, which hangs on already, end soon after this returns, too."""
    threading.Thread(target=_wait, args=(wait,), daemon=True).start()


@contextmanager
def at_work() -> Generator[None]:
    """Between the beginning and the end of a piece of work, which can be broken off but leaves nothing unfinished."""
    _at_work.set()
    try:
        if _ending.is_set():
            raise Ended
        yield
    finally:
        _at_work.clear()
        if _ending.is_set():
            os._exit(0)


def _of_parents() -> set[signal.Signals]:
    return {getattr(signal, name) for name in PARENTS if hasattr(signal, name)}


def _wait(wait: Callable[[], object]) -> NoReturn:
    wait()
    _ending.set()
    if _at_work.is_set():
        _thread.interrupt_main(signal.SIGTERM)
        threading.Event().wait(PATIENCE_S)
    os._exit(0)


def _end(number: int, frame: FrameType | None) -> None:
    """Break off what is under way, once: a second signal must not break off the cleaning up."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    _ending.set()
    if not _at_work.is_set():
        os._exit(0)
    raise Ended
