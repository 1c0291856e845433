"""Text and CSV: one event per line, t x y p, or in the order that a header line names."""

import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from evimo.errors import BadFile, EvimoWarning
from evimo.events.events import Events
from evimo.formats.event_file import EventFile
from evimo.formats.sensors import assumed_sensor
from evimo.formats.survey import Survey, surveyed
from evimo.formats.text_kernel import parse_lines

BLOCK_BYTES = 1 << 21
NAMES = (
    {"t", "ts", "time", "timestamp", "timestamps", "t_us", "time_us", "timestamp_us"},
    {"x", "col", "column"},
    {"y", "row"},
    {"p", "pol", "polarity", "on"},
)


@dataclass(frozen=True, slots=True)
class Layout:
    """How lines are to be read.

    start:   byte at which the first line of numbers begins.
    columns: numbers per line; order: which of them are t, x, y, p.
    seconds: whether times are in seconds, else in µs.
    sensor:  (height, width), where a first line `width height` tells it.
    """

    start: int
    columns: int
    order: tuple[int, int, int, int]
    seconds: bool = False
    sensor: tuple[int, int] | None = None


@dataclass(slots=True)
class Tally:
    """What the lines of one pass held besides events."""

    fractions: int = 0
    bad: int = 0
    first_bad: str = ""


def open_text(path: Path, sensor: tuple[int, int] | None = None) -> EventFile:
    """Open lines of t x y p: a decimal fraction in any time means seconds, whole numbers mean µs.

    Polarity is 0 or 1, or -1 or 1. A header line may name the columns in another order, a first line of two numbers
    is taken as width and height. Lines that are no events are left out with one warning.

    Raises:
        BadFile: most of the first lines are no events, or there is none.
    """
    layout = _layout(path)
    survey, tally, layout = _surveyed(path, layout)
    if tally.bad:
        text = f"{path.name}: {tally.bad:,} lines are no events (t x y p) and are left out, first {tally.first_bad!r}"
        warnings.warn(text, EvimoWarning, stacklevel=3)

    def read(start_us: int) -> Iterator[Events]:
        return (events for _, events in _blocks(path, layout, survey.place(start_us), Tally()))

    return EventFile(
        path=path,
        format=f"text (times in {'seconds' if layout.seconds else 'µs'})",
        sensor=sensor or layout.sensor or assumed_sensor(path, survey.extent),
        start_us=survey.start_us,
        stop_us=survey.stop_us,
        read=read,
    )


def _surveyed(path: Path, layout: Layout) -> tuple[Survey[int], Tally, Layout]:
    """One pass; a second one in seconds where a fraction is met after whole numbers only."""
    tally = Tally()
    survey = surveyed(path, _blocks(path, layout, layout.start, tally))
    if tally.fractions and not layout.seconds:
        return _surveyed(path, replace(layout, seconds=True))
    return survey, tally, layout


def _blocks(path: Path, layout: Layout, place: int, tally: Tally) -> Iterator[tuple[int, Events]]:
    """Blocks of whole lines from a byte on: (byte, events)."""
    with path.open("rb") as file:
        file.seek(place)
        rest = b""
        while more := file.read(BLOCK_BYTES):
            raw = rest + more
            cut = raw.rfind(b"\n") + 1
            raw, rest = raw[:cut], raw[cut:]
            if raw:
                yield place, _parsed(raw, layout, tally)
                place += len(raw)
        if rest:
            yield place, _parsed(rest, layout, tally)


def _parsed(raw: bytes, layout: Layout, tally: Tally) -> Events:
    parsed: tuple[Any, ...] = parse_lines(np.frombuffer(raw, np.uint8), layout.columns, layout.order, layout.seconds)
    x, y, t, p, fractions, bad, first_bad = parsed
    if bad and not tally.bad:
        tally.first_bad = raw[first_bad : first_bad + 60].split(b"\n")[0].decode(errors="replace").strip()
    tally.bad += bad
    tally.fractions += fractions
    return Events(x, y, t, p)


def _layout(path: Path) -> Layout:
    """The layout that the first lines show.

    Raises:
        BadFile: most of them are no events.
    """
    with path.open("rb") as file:
        raw = file.read(BLOCK_BYTES)
    lines = raw[: raw.rfind(b"\n") + 1] or raw
    layout = _heading(path, lines)
    tally = Tally()
    events = _parsed(lines[layout.start :], layout, tally)
    if tally.bad > len(events):
        raise BadFile(
            f"{path.name} is no event recording: the line {tally.first_bad!r} is not `t x y p`",
            fix="one event per line: time, column, row, polarity (0 and 1, or -1 and 1)",
        )
    return replace(layout, seconds=tally.fractions > 0)


def _heading(path: Path, raw: bytes) -> Layout:
    """What comes before the first event: comments, names of columns, the sensor's size."""
    start, sensor, order = 0, None, (0, 1, 2, 3)
    for line in raw.splitlines(keepends=True)[:100]:
        words = re.findall(r"[^\s,;]+", line.decode(errors="replace").lstrip("\ufeff"))
        if not words or words[0][0] in "#%":
            start += len(line)
        elif len(words) == 2 and all(word.isdecimal() for word in words):
            sensor = int(words[1]), int(words[0])
            start += len(line)
        elif not re.fullmatch(r"[-+\d.eE]+", words[0]):
            order = _order(path, words)
            start += len(line)
        else:
            return Layout(start, max(len(words), 4), order, sensor=sensor)
    return Layout(start, 4, order, sensor=sensor)


def _order(path: Path, words: list[str]) -> tuple[int, int, int, int]:
    """The columns of t, x, y, p by their names."""
    names = [re.sub(r"[\[(].*", "", word.strip("\"'").lower()) for word in words]
    found = [next((at for at, name in enumerate(names) if name in known), None) for known in NAMES]
    t, x, y, p = found
    if t is None or x is None or y is None or p is None:
        raise BadFile(
            f"{path.name} is no event recording: the heading {' '.join(words)[:60]!r} does not name t, x, y and p",
            fix="one event per line: time, column, row, polarity; name the columns t x y p or leave the heading out",
        )
    return t, x, y, p
