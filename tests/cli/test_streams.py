import io
import os

import pytest

from evimo.cli.streams import Guarded, NoOutput, guarded_streams


class Broken(io.StringIO):
    def write(self, text):
        raise BrokenPipeError(32, "Broken pipe")


def test_what_fails_on_stdout_is_told_and_on_stderr_is_not():
    with pytest.raises(NoOutput) as raised:
        Guarded(Broken(), needed=True).write("x")
    assert isinstance(raised.value.reason, BrokenPipeError)
    assert Guarded(Broken(), needed=False).write("x") == 1


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp1252", "cp437"])
def test_letters_that_a_terminal_lacks_become_similar_ones(monkeypatch, encoding):
    below = io.BytesIO()
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(below, encoding=encoding, write_through=True))
    with guarded_streams():
        print("12 µs, 640×480, 1 – 2 …, é, 漢, \udcff")
    text = below.getvalue().decode(encoding)
    assert text.startswith("12 ") and text.endswith("?, ?\n")
    assert (text == "12 us, 640x480, 1 - 2 ..., e, ?, ?\n") == (encoding == "ascii")


def test_streams_that_the_caller_closed_go_nowhere(monkeypatch):
    monkeypatch.setattr("sys.stdout", None)
    monkeypatch.setattr("sys.stderr", None)
    with guarded_streams():
        print("nobody reads this")


def test_a_wrong_use_of_a_stream_is_a_bug_as_ever(monkeypatch):
    class Wrong(io.StringIO):
        def write(self, text):
            raise ValueError("a mistake")

    with pytest.raises(ValueError, match="a mistake"):
        Guarded(Wrong(), needed=False).write("x")


def test_a_real_pipe_without_reader():
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "w") as stream:
        guarded = Guarded(stream, needed=True)
        guarded.write("x")
        with pytest.raises(NoOutput):
            guarded.flush()
