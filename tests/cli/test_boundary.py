import errno
import os
import signal
from contextlib import suppress

import numpy as np
import pytest

from evimo.cli.boundary import outcome
from evimo.cli.progress import progress
from evimo.cli.stopping import Stopped, asked_to_stop
from evimo.errors import BadFile


def fails_with(error):
    def fail():
        raise error

    return fail


@pytest.mark.parametrize("value, code", [(None, 0), (3, 3), ("text", 0)])
def test_a_command_may_return_its_exit_code(value, code):
    assert outcome(lambda: value) == code


@pytest.mark.parametrize(
    "error, words",
    [
        (BadFile("x is empty", fix="another file"), "error: x is empty\n  try: another file\n"),
        (
            OSError(errno.ENOSPC, "No space left on device"),
            "cannot write HERE: No space left on device\n  try: more room",
        ),
        (
            OSError(errno.EROFS, "Read-only file system", "/ro/x"),
            "cannot use /ro/x: Read-only file system\n  try: a folder",
        ),
        (PermissionError(errno.EACCES, "Permission denied", "y"), "cannot use y: Permission denied\n  try: a folder"),
        (OSError(errno.EIO, "Input/output error"), "cannot use HERE: Input/output error\n  try: look whether the disk"),
        (OSError(errno.EMFILE, "Too many open files", "z"), "Too many open files\n  try: a higher limit"),
        (MemoryError(), "error: not enough memory\n  try: "),
        (RuntimeError("can't start new thread"), "error: no more threads may be started\n  try: fewer --workers"),
    ],
)
def test_what_the_user_can_change_is_two_lines_and_exit_code_2(error, words, capsys):
    assert outcome(fails_with(error), place=lambda: "HERE") == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 2


def test_numpy_says_of_a_full_disk_what_it_can(capsys):
    """It gives no number of an error: here is one that it made itself."""
    with open("/dev/full", "wb", buffering=0) as full, pytest.raises(OSError) as raised:
        np.zeros(1 << 20).tofile(full)
    assert outcome(fails_with(raised.value)) == 2
    assert "No space left on device" in capsys.readouterr().err


def test_a_bug_keeps_its_traceback_and_says_that_it_is_one(capsys):
    assert outcome(fails_with(ZeroDivisionError("a / b"))) == 1
    *above, last = capsys.readouterr().err.splitlines()
    assert above[-1] == "ZeroDivisionError: a / b"
    assert "bug" in last and "report" in last


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_end_a_command_in_one_line(number, capsys):
    before = signal.getsignal(number)
    assert outcome(lambda: os.kill(os.getpid(), number)) == 128 + number
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert signal.getsignal(number) is before


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_some_commands_finish_what_they_are_at_and_the_second_signal_breaks_off(number, capsys):
    told = []

    def command():
        with asked_to_stop("slice", lambda: told.append(1)) as request:
            assert not request
            os.kill(os.getpid(), number)
            assert request and request.number == number
            os.kill(os.getpid(), number)

    assert outcome(command) == 128 + number
    assert told == [1]
    assert capsys.readouterr().err.startswith("stopping after this slice")


@pytest.mark.parametrize("numbers", [(signal.SIGINT,) * 3, (signal.SIGHUP, signal.SIGTERM)])
def test_signals_do_not_break_off_the_cleaning_up_after_the_first(numbers, capsys, monkeypatch):
    cleaned = []

    def command():
        try:
            os.kill(os.getpid(), numbers[0])
        finally:
            for number in numbers[1:]:
                os.kill(os.getpid(), number)
            cleaned.append(1)

    assert outcome(command) == 128 + numbers[0]
    assert cleaned == [1]
    monkeypatch.setattr("evimo.cli.stopping.PAUSE_S", -1.0)
    assert outcome(command) == 128 + numbers[1]
    assert cleaned == [1], "what takes too long can be broken off"
    assert len(capsys.readouterr().err.splitlines()) == 2


def test_a_signal_that_is_ignored_stays_ignored(monkeypatch):
    """As nohup wants it."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        assert outcome(lambda: os.kill(os.getpid(), signal.SIGHUP)) == 0
    finally:
        signal.signal(signal.SIGHUP, before)


def test_ctrl_c_without_a_handler_of_ours(capsys):
    assert outcome(fails_with(KeyboardInterrupt())) == 130
    assert outcome(fails_with(Stopped(signal.SIGTERM))) == 143
    assert capsys.readouterr().err == "interrupted\nended by SIGTERM\n"


@pytest.mark.parametrize("error", [SystemError("returned a result with an exception set"), NameError("half imported")])
def test_whatever_follows_a_signal_is_told_as_the_signal(error, capsys):
    """Numba's loader is C code that returns although an exception is set; others catch all that is raised in them."""

    def loads():
        try:
            os.kill(os.getpid(), signal.SIGTERM)
        except BaseException:
            raise error from None

    assert outcome(loads) == 128 + signal.SIGTERM
    assert capsys.readouterr().err == "ended by SIGTERM\n"
    assert outcome(fails_with(error)) == 1


def test_a_signal_that_got_lost_is_heard_with_the_next_progress(capsys):
    def goes_on():
        with suppress(BaseException):
            os.kill(os.getpid(), signal.SIGHUP)
        with progress(10) as advance:
            advance()
            raise AssertionError

    def begins_anew():
        with suppress(BaseException):
            os.kill(os.getpid(), signal.SIGHUP)
        with asked_to_stop("slice"):
            raise AssertionError

    assert outcome(goes_on) == outcome(begins_anew) == 128 + signal.SIGHUP
    assert "Traceback" not in capsys.readouterr().err
