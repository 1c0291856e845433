import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evimo.events.events import Events, joined, no_events


def counted(n):
    index = np.arange(n)
    return Events(index.astype(np.uint16), index.astype(np.uint16), (index // 3).astype(np.int64), np.ones(n, np.int8))


def test_between_is_half_open():
    events = counted(12)  # times 0 0 0 1 1 1 2 2 2 3 3 3
    assert events.between(1, 3).x.tolist() == [3, 4, 5, 6, 7, 8]
    assert len(events.between(3, 3)) == 0 and len(events.between(-5, 0)) == 0


def test_parts_are_views():
    events = counted(12)
    assert np.shares_memory(events.between(1, 2).t, events.t)


def test_no_events_are_empty_and_join():
    assert len(no_events()) == 0
    assert len(joined([])) == 0
    assert joined([no_events(), counted(4)]).x.tolist() == [0, 1, 2, 3]


@given(cuts=st.lists(st.integers(0, 12), max_size=6).map(sorted))
def test_joining_the_parts_gives_the_whole(cuts):
    events = counted(12)
    parts = [events.part(a, b) for a, b in zip([0, *cuts], [*cuts, 12], strict=True)]
    assert joined(parts).x.tolist() == events.x.tolist()


def test_events_are_immutable_fields():
    with pytest.raises(AttributeError):
        counted(1).x = np.zeros(1)
