"""AEDAT 4 recordings.

Read here and not through dv-processing, which waits for ever at a damaged packet and refuses files cut short.
"""

import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from evimo.errors import BadFile, EvimoWarning
from evimo.events.events import Events
from evimo.formats.aedat4_gyroscope import packet_gyroscope
from evimo.formats.aedat4_packets import Head, PacketTable, head, packet_events, packet_table, walked
from evimo.formats.choosing import chosen_of
from evimo.formats.event_file import EventFile
from evimo.formats.survey import Survey, no_events_in, surveyed

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
        survey = surveyed(path, _events(path, top, (at for at, name in _walk(path, top) if name == stream)))
        text = f"{path.name} is cut short: its first {survey.events:,} events are readable and used"
        warnings.warn(text, EvimoWarning, stacklevel=3)
    else:
        survey = _indexed(path, table.of(stream))

    def read(start_us: int) -> Iterator[Events]:
        return (events for _, events in _events(path, top, iter(survey.places[survey.block(start_us) :])))

    return EventFile(
        path=path,
        format="AEDAT 4",
        sensor=sensor or top.streams[stream].size,
        start_us=survey.start_us,
        stop_us=survey.stop_us,
        read=read,
        read_gyroscope=lambda: packet_gyroscope(path, top, table, stream),
        contents=_contents(top, table) | ({"topics": ", ".join(names.values())} if len(names) > 1 else {}),
        topic=names[stream] if len(names) > 1 else "",
    )


def _walk(path: Path, top: Head) -> Iterator[tuple[int, int]]:
    return walked(path, top.first_packet, path.stat().st_size)


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
    damaged = 0
    with path.open("rb") as file:
        for offset in offsets:
            try:
                yield offset, packet_events(file, offset, top.compression)
            except ValueError:
                damaged += 1
    if damaged:
        text = f"{path.name}: {damaged:,} packets of events are damaged and left out"
        warnings.warn(text, EvimoWarning, stacklevel=4)


def _contents(top: Head, table: PacketTable | None) -> dict[str, str]:
    cameras = [stream.camera for stream in top.streams.values() if stream.kind == "EVTS"]
    contents = {"camera name": ", ".join(dict.fromkeys(cameras))}
    for name, stream in top.streams.items():
        count = int(table.of(name).count.sum()) if table else None
        if stream.kind in STREAMS and count != 0:
            size = f", {stream.size[1]}x{stream.size[0]}" if any(stream.size) else ""
            contents[STREAMS[stream.kind]] = f"{'not counted' if count is None else f'{count:,}'}{size}"
    return contents
