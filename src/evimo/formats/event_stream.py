"""Event Stream (.es), version 2: DVS and ATIS recordings."""

import struct
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from evimo.errors import BadFile, EvimoWarning
from evimo.events.events import Events
from evimo.formats.event_file import EventFile
from evimo.formats.event_stream_kernel import decode_atis, decode_dvs
from evimo.formats.survey import surveyed

HEADER_BYTES = 20
BLOCK_BYTES = 1 << 20
DECODERS = {1: decode_dvs, 2: decode_atis}
OTHER_KINDS = {0: "generic bytes", 4: "asynchronous colour"}

Place = tuple[int, int]  # byte offset, and the time in µs reached there


def open_event_stream(path: Path, sensor: tuple[int, int] | None = None) -> EventFile:
    """Open an Event Stream file; rows are flipped as every reader does: y = height - 1 - stored.

    Raises:
        BadFile: another version or kind of stream, or no events.
    """
    kind, stored = _header(path)
    survey = surveyed(path, _blocks(path, kind, stored[0], (HEADER_BYTES, 0)))
    left = _left_over(path, kind, survey.places[-1])
    if left:
        text = f"{path.name} ends inside an event: its last {left} bytes are left out; was it cut short?"
        warnings.warn(text, EvimoWarning, stacklevel=3)

    def read(start_us: int) -> Iterator[Events]:
        return (events for _, events in _blocks(path, kind, stored[0], survey.place(start_us)))

    return EventFile(
        path=path,
        format=f"Event Stream 2 ({'DVS' if kind == 1 else 'ATIS'})",
        sensor=sensor or stored,
        start_us=survey.start_us,
        stop_us=survey.stop_us,
        read=read,
    )


def _header(path: Path) -> tuple[int, tuple[int, int]]:
    """The kind of stream and its (height, width)."""
    with path.open("rb") as file:
        header = file.read(HEADER_BYTES)
    if len(header) < HEADER_BYTES:
        raise BadFile(f"{path.name} ends inside its header", fix="copy or record it again: it was cut short")
    major, kind, width, height = struct.unpack("<12xB2xBHH", header)
    if major != 2:
        raise BadFile(f"{path.name} is Event Stream version {major}; only 2 is read", fix="convert it to version 2")
    if kind not in DECODERS:
        named = OTHER_KINDS.get(kind, f"kind {kind}")
        raise BadFile(f"{path.name} is an Event Stream of {named}", fix="give a stream of DVS or ATIS events")
    return kind, (height, width)


def _blocks(path: Path, kind: int, height: int, place: Place) -> Iterator[tuple[Place, Events]]:
    offset, t = place
    with path.open("rb") as file:
        file.seek(offset)
        raw = file.read(BLOCK_BYTES)
        while raw:
            x, y, times, p, used, reached = DECODERS[kind](np.frombuffer(raw, np.uint8), t, height)
            yield (offset, t), Events(x, y, times, p)
            offset, t, more = offset + used, reached, file.read(BLOCK_BYTES)
            if not more:
                return
            raw = raw[used:] + more


def _left_over(path: Path, kind: int, last: Place) -> int:
    """Bytes after the last whole event."""
    offset, t = last
    with path.open("rb") as file:
        file.seek(offset)
        raw = file.read()
    used: int = DECODERS[kind](np.frombuffer(raw, np.uint8), t, 1)[4]
    return len(raw) - used
