"""Files whose body is decoded from the front in blocks, with a state that goes from one block to the next."""

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import EvimoWarning
from evimo.events.events import Events
from evimo.formats.damage import MarredEvents
from evimo.formats.event_file import EventFile
from evimo.formats.realigning import Sense, found_loss
from evimo.formats.sensors import assumed_sensor
from evimo.formats.survey import surveyed

BLOCK_BYTES = 1 << 19  # of the fastest
LONGEST_BYTES = 1 << 26  # no more is held back for what follows
FEW_BYTES = 32  # of a block, or more, for each of its events: they are few

Place = tuple[int, NDArray[np.int64]]  # byte offset, and the decoder's state there
# A compiled decoder of items: x, y, t, p, the number of items used, the events lost. Items that it leaves are given
# again before those that follow; its last argument says that none do.
Decode = Callable[[NDArray[Any], NDArray[np.int64], bool], tuple[Any, Any, Any, Any, int, int]]


@dataclass(frozen=True, slots=True)
class WordFile:
    """A file, where its body begins, the type of its items, and what decodes them.

    sense: which items can be such; with it, items that a loss of bytes has shifted are found again.
    """

    path: Path
    offset: int
    item: np.dtype[Any]
    decode: Decode
    sense: Sense | None = None

    def blocks(self, place: Place) -> Iterator[tuple[Place, MarredEvents]]:
        """The events of each block from a place on, and where the block begins."""
        offset, state = place[0], place[1].copy()
        size, buffer, held = self.item.itemsize, bytearray(BLOCK_BYTES + self.item.itemsize), 0
        with self.path.open("rb", buffering=0) as file:
            file.seek(offset)
            while True:
                more = file.readinto(memoryview(buffer)[held:])
                filled, cut = held + more, 0
                if self.sense and (loss := found_loss(memoryview(buffer)[:filled], self.item, self.sense)):
                    cut = loss.last - loss.first
                    buffer[loss.first : filled - cut] = buffer[loss.last : filled]
                    filled -= cut
                count = filled // size
                items = np.frombuffer(buffer, self.item, count)
                before, last = state.copy(), not more or count * size >= LONGEST_BYTES
                *columns, used, lost = self.decode(items, state, last)
                if len(columns[0]) * FEW_BYTES < filled:  # who keeps them would keep the room for many
                    columns = [column.copy() for column in columns]
                yield (offset, before), MarredEvents(*columns, lost=lost + -(-cut // size))
                if not more:
                    return
                offset, held = offset + cut + used * size, filled - used * size
                left = bytes(memoryview(buffer)[used * size : used * size + held])
                if 2 * held > len(buffer):
                    buffer = bytearray(2 * len(buffer))
                buffer[:held] = left

    def warn_if_cut(self, holds: str, *, stacklevel: int) -> None:
        """Say that a part of an item at the end is left out; `holds` is what an item is called."""
        if left := (self.path.stat().st_size - self.offset) % self.item.itemsize:
            text = f"{self.path.name} ends inside {holds}: its last {left} bytes are left out; was it cut short?"
            warnings.warn(text, EvimoWarning, stacklevel=stacklevel + 1)


def open_words(
    words: WordFile, state: NDArray[np.int64], *, title: str, size: tuple[int, int] | None, holds: str
) -> EventFile:
    """Open a file of words from its first one on; a part of one at its end is left out with a warning.

    Args:
        words: where they are, and what decodes them.
        state: the decoder's, before the first.
        title: of the format.
        size: of the sensor, where it is known.
        holds: what an item is called.

    Raises:
        BadFile: it holds no events, or their order is lost.
    """
    path = words.path
    survey = surveyed(path, words.blocks((words.offset, state)))
    words.warn_if_cut(holds, stacklevel=4)

    def read(start_us: int) -> Iterator[Events]:
        return (events for _, events in words.blocks(survey.place(start_us)))

    return EventFile(
        path=path,
        format=title,
        sensor=size or assumed_sensor(path, survey.extent),
        start_us=survey.start_us,
        stop_us=survey.stop_us,
        read=read,
    )
