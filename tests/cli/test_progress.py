import re

import pytest

from evimo.cli import progress as module
from evimo.cli.progress import Pace, progress


@pytest.fixture
def clock(monkeypatch):
    """Seconds that pass only when the test says so."""
    now = [100.0]
    monkeypatch.setattr(module.time, "perf_counter", lambda: now[0])

    def wait(seconds):
        now[0] += seconds

    return wait


def test_lines_tell_rate_and_time_left_from_the_second_slice_on(clock, capsys):
    """One slice says nothing of the rate, however long the first one took."""
    with progress(50) as advance:
        clock(60)
        advance()
        assert not capsys.readouterr().err
        clock(2)
        advance()
    assert capsys.readouterr().err == "2 of 50 slices, 0.5 slices/s, 96 s left\n"


def test_what_was_there_before_tells_nothing_of_the_pace(clock):
    """A resumed simulation that was finished said 360380.48 recordings/s."""
    pace = Pace(10, "recordings")
    for _ in range(8):
        pace.add(1, made=False)
        clock(0.001)
    assert pace.words() == "8 of 10 recordings"
    clock(3)
    pace.add(1, made=True)
    assert pace.words() == "9 of 10 recordings"
    clock(4)
    pace.add(1, made=True)
    assert pace.words() == "10 of 10 recordings, 0.25 recordings/s"


@pytest.mark.parametrize("total", [0, 1, 3, 1e9])
@pytest.mark.parametrize("step_s", [0, 1e-9, 1e-3, 1e5])
def test_nothing_absurd_is_said(clock, total, step_s):
    pace = Pace(total, "slices")
    for _ in range(3):
        pace.add(1, made=True)
        clock(step_s)
        words = pace.words()
        assert not re.search(r"inf|nan|e\d| -\d", words)
        assert (rate := re.search(r"([\d.e+-]+) slices/s", words)) is None or float(rate[1]) < 10


def test_no_bar_and_no_colour_where_there_is_no_terminal(monkeypatch, capsys):
    monkeypatch.setattr(module, "EVERY_S", 0.0)
    monkeypatch.setattr(module, "SHORTEST_S", 0.0)
    with progress(3) as advance:
        for _ in range(3):
            advance(facts="loss 1")
    said = capsys.readouterr().err
    assert said.isascii() and "\r" not in said and "\x1b" not in said
    assert len(said.splitlines()) == 1


@pytest.mark.parametrize("columns", ["1", "20", "80", "nonsense", "0"])
@pytest.mark.parametrize("encoding", ["utf-8", "ascii"])
def test_a_terminal_of_any_width_and_alphabet(monkeypatch, columns, encoding):
    import io

    class Terminal(io.TextIOWrapper):
        def isatty(self):
            return True

    below = io.BytesIO()
    monkeypatch.setenv("COLUMNS", columns)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr("sys.stderr", Terminal(below, encoding=encoding, write_through=True))
    with progress(2) as advance:
        advance()
        advance()
    assert below.getvalue()


def test_one_of_several_processes_talks(capsys):
    with progress(2, silent=True) as advance:
        advance()
    assert capsys.readouterr().err == ""
