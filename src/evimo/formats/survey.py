"""The first pass over a file without an index: its span, its extent, and where to begin reading for a given time."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile
from evimo.events.events import Events

Place = TypeVar("Place")


@dataclass(frozen=True, slots=True)
class Survey(Generic[Place]):
    """What one pass over all blocks of a file found.

    start_us:   earliest event of the first block.
    stop_us:    latest event of all + 1.
    events:     how many.
    extent:     (height, width), one more than the largest row and column.
    places:     where each block begins, in the reader's own terms.
    reached_us: the latest time before each block.
    """

    start_us: int
    stop_us: int
    events: int
    extent: tuple[int, int]
    places: list[Place]
    reached_us: NDArray[np.int64]

    def block(self, start_us: int) -> int:
        """The number of the last block before which no event is at or after start_us."""
        return max(int(np.searchsorted(self.reached_us, start_us)) - 1, 0)

    def place(self, start_us: int) -> Place:
        """Where that block begins."""
        return self.places[self.block(start_us)]


def surveyed(path: Path, blocks: Iterable[tuple[Place, Events]]) -> Survey[Place]:
    """One pass over (place, events) blocks, keeping two numbers per block.

    Raises:
        BadFile: there is no event.
    """
    places: list[Place] = []
    reached: list[int] = []
    start, newest, count, height, width = 0, int(np.iinfo(np.int64).min), 0, 0, 0
    for place, events in blocks:
        if not len(events):
            continue
        start = start if places else int(events.t.min())
        places.append(place)
        reached.append(newest)
        newest = max(newest, int(events.t.max()))
        count += len(events)
        height, width = max(height, int(events.y.max()) + 1), max(width, int(events.x.max()) + 1)
    if not places:
        raise no_events_in(path)
    return Survey(start, newest + 1, count, (height, width), places, np.array(reached, np.int64))


def no_events_in(path: Path) -> BadFile:
    """The error for a recording without a single event."""
    return BadFile(f"{path.name} holds no events", fix="record or export it again; nothing in it can be shown")
