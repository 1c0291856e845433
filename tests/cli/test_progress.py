import re

import pytest

from evimo.cli import progress as module
from evimo.cli.progress import progress


@pytest.mark.parametrize("total", [3, 50])
def test_lines_tell_rate_and_time_left_from_the_second_slice_on(monkeypatch, capsys, total):
    """One slice says nothing of the rate, however long the first one took."""
    monkeypatch.setattr(module, "EVERY_S", 0.0)
    with progress(total) as advance:
        advance()
        assert not capsys.readouterr().err
        advance()
    (line,) = capsys.readouterr().err.splitlines()
    assert re.fullmatch(rf"2 of {total} slices, \d+\.\d slices/s, \d+ s left", line)
