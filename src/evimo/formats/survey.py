"""The first pass over a file without an index: its span, its extent, and where to begin reading for a given time."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile
from evimo.events.events import Events, no_events
from evimo.formats.clock import Clock, Faults
from evimo.formats.event_file import refuse_disorder, refuse_strange_times
from evimo.formats.sensors import extent_of

Place = TypeVar("Place")
LONG_AGO = int(np.iinfo(np.int64).min)


@dataclass(slots=True)
class Survey(Generic[Place]):
    """What one pass over all blocks of a file found, of the events that keep its clock.

    start_us:   earliest event.
    stop_us:    latest event + 1.
    events:     how many keep the clock.
    extent:     (height, width), one more than the largest row and column.
    places:     where each block begins, in the reader's own terms.
    reached_us: the latest time before each block, or later; never falling.
    stored:     how many events there are at all.
    """

    start_us: int = 0
    stop_us: int = LONG_AGO
    events: int = 0
    extent: tuple[int, int] = (0, 0)
    places: list[Place] = field(default_factory=list[Place])
    reached_us: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    stored: int = 0

    def block(self, start_us: int) -> int:
        """The number of the last block before which no event is at or after start_us."""
        return max(int(np.searchsorted(self.reached_us, start_us)) - 1, 0)

    def place(self, start_us: int) -> Place:
        """Where that block begins."""
        return self.places[self.block(start_us)]

    def add(self, kept: Events) -> None:
        """Take in events that keep the clock."""
        if not len(kept):
            return
        earliest = int(kept.t.min())
        self.start_us = min(self.start_us, earliest) if self.events else earliest
        self.stop_us = max(self.stop_us, int(kept.t.max()) + 1)
        self.extent = max(self.extent[0], extent_of(kept.y)), max(self.extent[1], extent_of(kept.x))
        self.events += len(kept)


def surveyed(path: Path, blocks: Iterable[tuple[Place, Events]]) -> Survey[Place]:
    """One pass over (place, events) blocks, keeping two numbers per block.

    Raises:
        BadFile: there is no event, or their order in time is lost.
    """
    faults = Faults()
    clock = Clock(faults)
    survey, reached = Survey[Place](), list[int]()
    for place, events in blocks:
        if not len(events):
            continue
        before_us = clock.reached_us
        kept = clock.kept(events)
        if clock.began_anew:
            survey, reached = Survey[Place](stored=survey.stored), list[int]()
        survey.places.append(place)
        reached.append(before_us if reached else LONG_AGO)
        survey.stored += len(events)
        survey.add(kept)
    survey.add(clock.kept(no_events(), final=True))
    refuse_disorder(path, faults, survey.events)
    # An event that waited for its verdict may have been an outlier: what is reached later bounds it.
    survey.reached_us = np.minimum.accumulate(np.array(reached, np.int64)[::-1])[::-1]
    if not survey.events:
        raise no_events_in(path)
    refuse_strange_times(path, faults, survey.events, survey.stop_us - survey.start_us)
    return survey


def no_events_in(path: Path) -> BadFile:
    """The error for a recording without a single event."""
    return BadFile(f"{path.name} holds no events", fix="record or export it again; nothing in it can be shown")
