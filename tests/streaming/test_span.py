import numpy as np
import pytest

from evimo.errors import BadInput
from evimo.events.events import Events
from evimo.streaming.span import span_of


@pytest.fixture
def one_second(recorded):
    """Events from 10 012 ms to 11 012 ms: the grid has lines at 10 000, 10 025, … 11 000."""
    t = np.array([10_012_000, 11_011_999])
    nothing = np.zeros(2)
    return recorded(Events(nothing.astype(np.uint16), nothing.astype(np.uint16), t, nothing.astype(np.int8)))


def test_all_of_it(one_second):
    span = span_of(one_second)
    assert (span.first, span.last, len(span), span.length_s) == (400, 440, 40, 1.0)
    assert (span.read_start_us, span.read_stop_us) == (10_012_000, 11_012_000)


@pytest.mark.parametrize(
    ("start_s", "stop_s", "slices"),
    [
        (0.0, 0.1, range(400, 404)),  # to 10 112 ms: the slice that ends at 10 125 is not complete by then
        (0.013, 0.1, range(401, 404)),  # 10 025 ms: exactly on a line
        (0.0129, 0.113, range(400, 405)),
        (0.5, None, range(420, 440)),
        (0.0, 99.0, range(400, 440)),
    ],
)
def test_slices_from_the_one_that_holds_start_to_those_that_end_by_stop(one_second, start_s, stop_s, slices):
    span = span_of(one_second, start_s=start_s, stop_s=stop_s)
    assert range(span.first, span.last) == slices


def test_neighbours_are_read_too(one_second):
    """One slice whose mask has a say, and two to each side of a stack, whose slices have stacks of their own."""
    span = span_of(one_second, start_s=0.5, stop_s=0.6)
    assert span.read_start_us == (420 - 5) * 25_000
    assert span.read_stop_us == (span.last + 5) * 25_000


@pytest.mark.parametrize(
    ("start_s", "stop_s"),
    [(-1, None), (1.0, None), (2.0, None), (0.5, 0.5), (0.6, 0.5), (float("nan"), None), (0.0, float("inf"))],
)
def test_no_part_of_the_recording(one_second, start_s, stop_s):
    with pytest.raises(BadInput, match=r"no part of a recording of 1\.000 s"):
        span_of(one_second, start_s=start_s, stop_s=stop_s)


def test_shorter_than_a_slice(one_second):
    with pytest.raises(BadInput, match="no complete slice"):
        span_of(one_second, start_s=0.1, stop_s=0.105)
