from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evimo.errors import BadFile
from evimo.events.events import Events
from evimo.formats.survey import surveyed


def block(times, x=0):
    n = len(times)
    return Events(
        np.full(n, x, np.uint16), np.full(n, 2 * x, np.uint16), np.array(times, np.int64), np.ones(n, np.int8)
    )


def test_survey_knows_span_count_and_extent():
    survey = surveyed(Path("x"), [("a", block([5, 3])), ("b", block([])), ("c", block([9, 7, 8], x=20))])
    assert (survey.start_us, survey.stop_us, survey.events, survey.extent) == (3, 10, 5, (41, 21))
    assert survey.places == ["a", "c"]


@given(
    blocks=st.lists(st.lists(st.integers(0, 50), min_size=1, max_size=5), min_size=1, max_size=8),
    start=st.integers(-5, 60),
)
def test_no_event_at_or_after_the_start_lies_before_the_place(blocks, start):
    place = surveyed(Path("x"), list(enumerate(map(block, blocks)))).place(start)
    assert all(t < start for times in blocks[:place] for t in times)
    if place + 1 < len(blocks):
        assert any(t >= start for times in blocks[: place + 1] for t in times)


def test_no_events_are_an_error():
    with pytest.raises(BadFile, match=r"x\.txt holds no events"):
        surveyed(Path("x.txt"), [("a", block([]))])
