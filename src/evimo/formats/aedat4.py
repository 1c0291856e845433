"""AEDAT 4 recordings.

Read here and not through dv-processing, which waits for ever at a damaged packet and refuses files cut short.
"""

import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, EvimoWarning
from evimo.events.events import Events
from evimo.formats.aedat4_gyroscope import packet_gyroscope
from evimo.formats.aedat4_packets import Head, PacketTable, head, packet_records, packet_table, walked
from evimo.formats.choosing import chosen_of, listed
from evimo.formats.event_file import EventFile
from evimo.formats.event_record_kernel import decode_aedat4
from evimo.formats.survey import Survey, no_events_in, surveyed

TOGETHER = 1 << 17  # events
STREAMS = {"FRME": "frames", "IMUS": "IMU", "TRIG": "triggers", "POSE": "poses", "BBOX": "boxes", "TKPS": "key points"}


def open_aedat4(path: Path, sensor: tuple[int, int] | None = None, *, topic: str | None = None) -> EventFile:
    """Open an AEDAT 4 recording; of several streams of events that of `topic`, else the one with the most.

    A file without its table of packets, because it was cut short, is used as far as it is readable, with a warning;
    damaged packets are left out with one.

    Raises:
        BadFile: without events, or nothing is readable. NotFound: no such topic.
    """
    top = head(path)
    table = packet_table(path, top)
    names = _event_streams(path, top, table)
    stream = list(names)[chosen_of(path, list(names.values()), topic)]
    if table is None:
        survey = surveyed(path, _events(path, top, _walk(path, top, stream, top.first_packet)))
        text = f"{path.name} is cut short: its first {survey.events:,} events are readable and used"
        warnings.warn(text, EvimoWarning, stacklevel=3)
    else:
        survey = _indexed(path, table.of(stream))

    def read(start_us: int) -> Iterator[Events]:
        first = survey.block(start_us)
        walk = _walk(path, top, stream, survey.places[first]) if table is None else iter(survey.places[first:])
        return (events for _, events in _events(path, top, walk))

    return EventFile(
        path=path,
        format="AEDAT 4",
        sensor=sensor or top.streams[stream].size,
        start_us=survey.start_us,
        stop_us=survey.stop_us,
        read=read,
        read_gyroscope=lambda: packet_gyroscope(path, top, table, stream),
        contents=_contents(top, table) | ({"topics": listed(list(names.values()))} if len(names) > 1 else {}),
        topic=names[stream] if len(names) > 1 else "",
    )


def _walk(path: Path, top: Head, stream: int, first: int) -> Iterator[int]:
    """Byte offset of each whole packet of a stream, from that at a byte offset on."""
    return (at for at, name in walked(path, first, path.stat().st_size) if name == stream)


def _event_streams(path: Path, top: Head, table: PacketTable | None) -> dict[int, str]:
    """Streams of events with their names, CAMERA/OUTPUT, the most events first.

    Raises:
        BadFile: there are none.
    """
    found = [number for number, stream in top.streams.items() if stream.kind == "EVTS"]
    if not found:
        kinds = ", ".join(stream.kind for stream in top.streams.values())
        raise BadFile(f"{path.name} has no stream of events, only {kinds or 'nothing'}", fix="record events (EVTS)")
    if table is not None:
        found.sort(key=lambda number: -int(table.of(number).count.sum()))
    names = {number: f"{top.streams[number].camera}/{top.streams[number].output}" for number in found}
    again = len(set(names.values())) < len(names)
    return {number: f"{name} {number}" if again else name for number, name in names.items()}


def _indexed(path: Path, table: PacketTable) -> Survey[int]:
    """What a survey would find, from the table."""
    if not len(table.offset):
        raise no_events_in(path)
    reached = np.maximum.accumulate(table.stop_us)
    before = np.concatenate(([np.iinfo(np.int64).min], reached[:-1]))
    start, stop, count = int(table.start_us[0]), int(reached[-1]) + 1, int(table.count.sum())
    return Survey(start, stop, count, (0, 0), table.offset.tolist(), before)


def _events(path: Path, top: Head, offsets: Iterator[int]) -> Iterator[tuple[int, Events]]:
    """Events of many packets together, and where the first of these packets begins."""
    damaged, together = 0, Together()
    with path.open("rb", buffering=0) as file:
        for offset in offsets:
            try:
                records = packet_records(file, offset, top.compression)
            except ValueError:
                damaged += 1
                continue
            if not together.has_room(len(records)):
                if len(together):
                    yield together.first, together.events()
                together = Together(len(records))
            together.add(offset, records)
    if len(together):
        yield together.first, together.events()
    if damaged:
        text = f"{path.name}: {damaged:,} packets of events are damaged and left out"
        warnings.warn(text, EvimoWarning, stacklevel=4)


class Together:
    """Events of packets that follow each other: one packet alone is too short to be judged fast."""

    def __init__(self, least: int = 0) -> None:
        most = max(TOGETHER, least)
        self._columns = tuple(np.empty(most, kind) for kind in ("u2", "u2", "i8", "i1"))
        self._most, self._count, self.first = most, 0, 0

    def __len__(self) -> int:
        return self._count

    def has_room(self, count: int) -> bool:
        """Whether there is room for so many more."""
        return self._count + count <= self._most

    def add(self, offset: int, records: NDArray[np.uint64]) -> None:
        """Take in the records (N, 2) of the packet at a byte offset."""
        self.first = self.first if self._count else offset
        decode_aedat4(records, self._columns, self._count)
        self._count += len(records)

    def events(self) -> Events:
        """All of them; where they are few, who keeps them does not keep the room for many."""
        few = 2 * self._count < self._most
        return Events(*(column[: self._count].copy() if few else column[: self._count] for column in self._columns))


def _contents(top: Head, table: PacketTable | None) -> dict[str, str]:
    cameras = [stream.camera for stream in top.streams.values() if stream.kind == "EVTS"]
    contents = {"camera name": ", ".join(dict.fromkeys(cameras))}
    for name, stream in top.streams.items():
        count = int(table.of(name).count.sum()) if table else None
        if stream.kind in STREAMS and count != 0:
            size = f", {stream.size[1]}x{stream.size[0]}" if any(stream.size) else ""
            contents[STREAMS[stream.kind]] = f"{'not counted' if count is None else f'{count:,}'}{size}"
    return contents
