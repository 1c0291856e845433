"""Text and CSV: one event per line, t x y p, or in another order that a heading, the user or the numbers tell."""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from evimo.errors import BadFile, EvimoWarning
from evimo.events.events import Events
from evimo.formats.event_file import EventFile
from evimo.formats.sensors import assumed_sensor, upright
from evimo.formats.survey import Survey, surveyed
from evimo.formats.text_kernel import BAD, FIRST_BAD, FRACTIONS, ROUNDED, parse_lines
from evimo.formats.text_layout import Layout, text_layout
from evimo.formats.text_source import TextSource, text_source
from evimo.formats.time_units import NAMES, TimeUnit, check_span
from evimo.formats.wraps import Reached, continued

Place = tuple[int, Reached]  # byte offset, and the counter's state there


@dataclass(slots=True)
class Tally:
    """What the lines of one pass held besides events."""

    events: int = 0
    fractions: int = 0
    rounded: int = 0
    bad: int = 0
    first_bad: str = ""


def open_text(
    path: Path,
    sensor: tuple[int, int] | None = None,
    *,
    time_unit: TimeUnit | None = None,
    columns: str | None = None,
) -> EventFile:
    """Open lines of t x y p, plain or compressed; the unit of times is guessed and checked where it is not said.

    Polarity is 0 or 1, -1 or 1, or True or False. A heading may name the columns and the sensor's size. Lines that
    are no events are left out with one warning.

    Raises:
        BadFile: most of the lines are no events, or there is none.
    """
    source = text_source(path)
    find = partial(text_layout, source, unit=time_unit, columns=columns)
    layout = find()
    survey, tally = _surveyed(source, layout)
    if tally.fractions and not layout.dotted:  # met only far in the file
        layout = find(dotted=True)
        survey, tally = _surveyed(source, layout)
    if not layout.told:
        check_span(path, events=survey.events, span_us=survey.stop_us - survey.start_us, unit=layout.unit)
    _warn(path, tally)

    def read(start_us: int) -> Iterator[Events]:
        return (events for _, events in _blocks(source, layout, survey.place(start_us), Tally()))

    return EventFile(
        path=path,
        format=f"text (times in {NAMES[layout.unit]}{'' if layout.told else ', guessed'})",
        sensor=sensor or upright(path, layout.sensor, survey.extent) or assumed_sensor(path, survey.extent),
        start_us=survey.start_us,
        stop_us=survey.stop_us,
        read=read,
    )


def _surveyed(source: TextSource, layout: Layout) -> tuple[Survey[Place], Tally]:
    """One pass over all lines.

    Raises:
        BadFile: most of them are no events.
    """
    tally = Tally()
    try:
        survey = surveyed(source.path, _blocks(source, layout, (layout.start, Reached()), tally))
    finally:
        _refuse_other_lines(source.path, layout, tally)
    return survey, tally


def _refuse_other_lines(path: Path, layout: Layout, tally: Tally) -> None:
    """Refuse a file most of whose lines are no events.

    Raises:
        BadFile: it is one.
    """
    if tally.bad > tally.events:
        raise BadFile(
            f"{path.name} is no event recording: {tally.bad:,} lines, such as {tally.first_bad!r}, are not "
            f"`{' '.join(layout.columns)}`",
            fix="one event per line: time, column, row, polarity (0 and 1, or -1 and 1); --columns tells another order",
        )


def _warn(path: Path, tally: Tally) -> None:
    parts: list[str] = []
    if tally.bad:
        parts.append(f"{tally.bad:,} lines are no events and are left out, first {tally.first_bad!r}")
    if tally.rounded:
        parts.append(f"{tally.rounded:,} events lie between pixels and are rounded to the nearest")
    if parts:
        warnings.warn(f"{path.name}: {'; '.join(parts)}", EvimoWarning, stacklevel=4)


def _blocks(source: TextSource, layout: Layout, place: Place, tally: Tally) -> Iterator[tuple[Place, Events]]:
    """Blocks of events from a place on."""
    roles, reached = layout.roles, place[1]
    for at, raw in source.blocks(place[0]):
        parsed: tuple[Any, ...] = parse_lines(np.frombuffer(raw, np.uint8), roles, layout.power)
        x, y, t, p, counts = parsed
        if counts[BAD] and not tally.bad:
            first = int(counts[FIRST_BAD])
            tally.first_bad = raw[first : first + 60].split(b"\n")[0].decode(errors="replace").strip()
        tally.bad += int(counts[BAD])
        tally.events += len(x)
        tally.fractions += int(counts[FRACTIONS])
        tally.rounded += int(counts[ROUNDED])
        before = reached
        t, reached = continued(t, before)
        yield (at, before), Events(x, y, t, p)
