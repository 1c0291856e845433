"""How the lines of a text file are to be read: by what its heading says, what its columns hold, and its times."""

import re
import warnings
from dataclasses import dataclass, replace
from decimal import Decimal, InvalidOperation, Overflow
from pathlib import Path
from statistics import mode

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, EvimoWarning
from evimo.formats.columns import (
    found_columns,
    named_columns,
    refuse_named_parts,
    refuse_normalised,
    refuse_split_times,
    said_columns,
)
from evimo.formats.sensors import NOWHERE, fitting_sensor
from evimo.formats.survey import no_events_in
from evimo.formats.text_heading import NUMBER, Heading, heading_of, named_words
from evimo.formats.text_kernel import parse_lines
from evimo.formats.text_source import TextSource
from evimo.formats.time_units import POWERS, Times, TimeUnit, found_unit, is_plausible, repeat_of

SAMPLE_LINES = 500  # of each piece: 0.01 s to read
SHARES = np.linspace(0.1, 0.97, 7)  # of the file, where more pieces are looked at
SAMPLE_BYTES = 1 << 15
SPACES = re.compile(r"[\s,;\"']+")
TRUTH = {"true": 1.0, "false": 0.0, "on": 1.0, "off": 0.0}
CLOCK = re.compile(r"\d{1,2}:\d\d(:\d\d)?(\.\d+)?")  # a word of its own, behind a date
COLUMNS = np.array([4, 0, 1, 2, 3])  # roles of _ t x y p, as `text_kernel` has them


@dataclass(frozen=True, slots=True)
class Layout:
    """How lines are to be read.

    start:   byte at which the first line of numbers begins.
    columns: what each column holds: t, x, y, p, or _ for what is left out.
    unit:    of the times.
    told:    whether the user or the heading says it.
    dotted:  whether a time with a decimal point was met.
    sensor:  (height, width), where the heading tells it.
    """

    start: int
    columns: str
    unit: TimeUnit
    told: bool
    dotted: bool
    sensor: tuple[int, int] | None = None

    @property
    def roles(self) -> NDArray[np.int64]:
        """The columns as numbers."""
        return roles_of(self.columns)

    @property
    def power(self) -> int:
        """Of ten, from the unit to µs."""
        return POWERS[self.unit]


def roles_of(columns: str) -> NDArray[np.int64]:
    """Return columns as the numbers that `text_kernel` has for them."""
    return COLUMNS[["_txyp".index(letter) for letter in columns]]


def text_layout(source: TextSource, *, unit: TimeUnit | None, columns: str | None, dotted: bool = False) -> Layout:
    """Find the layout of a text file; what the user says of unit and columns is not guessed.

    Raises:
        BadFile: there are no lines of numbers, or no sense in them.
    """
    lines = _beginning(source)
    heading = heading_of(lines)
    pieces = [rows for raw in (lines[heading.length :], *_further(source)) if (rows := _rows(raw))]
    if not pieces:
        raise _no_numbers(source.path, lines)
    width = mode(len(row) for rows in pieces for row in rows)
    pieces = [[row for row in rows if len(row) == width] for rows in pieces]
    sample, shown = _numbers([row for rows in pieces for row in rows]), next(row for rows in pieces for row in rows)
    if not columns and len(heading.columns or "") != width:
        _refuse_words(source.path, [[word for word in shown if CLOCK.fullmatch(word)]])
    order = _order(source.path, heading, columns, sample, " ".join(shown)[:60])
    written = [[row[order.index("t")] for row in rows] for rows in pieces if rows]
    if not columns:
        _refuse_decimals(source.path, order, written, sample)
    _refuse_words(source.path, written)
    refuse_normalised(source.path, *(sample[:, order.index(letter)] for letter in "xy"))
    dotted = dotted or any("." in time for times in written for time in times)
    times = replace(_times(written, sample, order), repeat=_repeat(lines[heading.length :], order, dotted))
    if unit is None and heading.unit is not None and is_plausible(times, heading.unit):
        unit = heading.unit
    guessed = found_unit(source.path, times, said=unit, usual="s" if dotted else "us")
    return Layout(heading.length, order, guessed, unit is not None, dotted, heading.sensor)


def _beginning(source: TextSource) -> bytes:
    """The first lines, the last one of a short file included where nothing ends it."""
    blocks = source.blocks()
    _, lines = next(blocks, (0, b""))
    return lines + next(blocks, (0, b""))[1] if len(lines) < SAMPLE_BYTES else lines


def _order(path: Path, heading: Heading, said: str | None, sample: NDArray[np.float64], shown: str) -> str:
    """The letters of the columns: as the user says, as the heading does, or from what they hold.

    Raises:
        BadFile: they are not as many, or nothing tells; or times lie in two of them.
    """
    width = sample.shape[1]
    if not said:
        refuse_named_parts(path, heading.words, sample)
    if said:
        order = said_columns(said)
    elif heading.columns and width in (len(heading.columns), len(heading.columns.strip("_"))):
        order = heading.columns if len(heading.columns) == width else heading.columns.strip("_")
    else:
        order = _guessed(path, heading, sample, shown)
    if len(order) != width:
        raise BadFile(
            f"{path.name} has {width} columns in {shown!r}, not the {len(order)} of {order!r}",
            fix="a letter for each column with --columns, as in txyp; _ for one to leave out",
        )
    if not said:
        refuse_split_times(path, sample, order)
    return order


def _guessed(path: Path, heading: Heading, sample: NDArray[np.float64], shown: str) -> str:
    """The letters of the columns from what they hold; a warning says so where a heading does not fit them.

    Raises:
        BadFile: nothing tells.
    """
    width = sample.shape[1]
    named = heading.columns and f"its heading names {len(heading.columns)} columns, and its lines hold {width}"
    try:
        order = found_columns(path, sample, shown)
    except BadFile as error:
        if not named:
            raise
        fix = "write whole numbers without marks for thousands; or name the columns with --columns, as in txyp"
        raise BadFile(f"{path.name}: {named}, as in {shown!r}", fix=fix) from error
    if not named and len(named_words(heading.unknown)) == width:
        named = f"its heading {heading.unknown[:60]!r} names no columns that are known"
    if named and order != f"_{heading.columns}":  # before which rows are counted
        text = f"{path.name}: {named}: taken as {order}; --columns says their order"
        warnings.warn(text, EvimoWarning, stacklevel=7)
    return order


def _refuse_decimals(path: Path, order: str, written: list[list[str]], sample: NDArray[np.float64]) -> None:
    """Refuse times that are the decimals of the seconds before them: those begin with zeros, and are of one length.

    Raises:
        BadFile: they are, as the column before them mostly stands still and never falls.
    """
    times = [time for each in written for time in each]
    lengths, at = {len(time) for time in times}, order.index("t")
    padded = len(lengths) == 1 and min(lengths) > 2 and any(time.isdecimal() and time[0] == "0" for time in times)
    if not padded or at == 0 or order[at - 1] != "_":
        return
    steps = np.diff(sample[:, at - 1])
    if np.all(steps >= 0) and 2 * np.count_nonzero(steps) <= len(steps):
        seconds, rest = f"{sample[0, at - 1]:g}", times[0]
        raise BadFile(
            f"{path.name} has its times in two columns, seconds and what is left of them, as in {seconds} and {rest}",
            fix="write them as one number, with a decimal point; or choose a column with --columns",
        )


def _refuse_words(path: Path, written: list[list[str]]) -> None:
    """Refuse times that are dates or the like.

    Raises:
        BadFile: most of them are no numbers.
    """
    words = [time for times in written for time in times if not NUMBER.fullmatch(time)]
    if 2 * len(words) > sum(map(len, written)):
        raise BadFile(
            f"{path.name}: its times, such as {words[0][:40]!r}, are no numbers",
            fix="write them as decimal numbers of s, ms, µs or ns; --columns tells which column holds them",
        )


def _further(source: TextSource) -> list[bytes]:
    """Lines from the rest of the file, where they can be reached."""
    if not source.can_jump or source.path.stat().st_size < 2 * SAMPLE_BYTES:
        return []
    return [source.lines_near(share, SAMPLE_BYTES) for share in SHARES]


def _rows(raw: bytes) -> list[list[str]]:
    """The words of the first lines of numbers."""
    rows: list[list[str]] = []
    for line in raw[: SAMPLE_BYTES * 4].decode(errors="replace").split("\n")[: 2 * SAMPLE_LINES]:
        words = [word for word in SPACES.split(line) if word]
        if words and sum(bool(NUMBER.fullmatch(word)) for word in words) >= 3 and words[0][0] not in "#%":
            rows.append(words)
    return rows[:SAMPLE_LINES]


def _numbers(rows: list[list[str]]) -> NDArray[np.float64]:
    return np.array([[_number(word) for word in row] for row in rows], np.float64)


def _number(word: str) -> float:
    try:
        return float(word.replace("\u2212", "-"))
    except ValueError:
        return TRUTH.get(word.lower(), np.nan)


def _times(written: list[list[str]], sample: NDArray[np.float64], order: str) -> Times:
    """What the sampled lines tell of the unit."""
    x, y = (sample[:, order.index(letter)] for letter in "xy")
    extent = [int(np.max(side[side < NOWHERE], initial=0)) + 1 for side in (y, x)]
    height, width = fitting_sensor((extent[0], extent[1]))
    pieces = [np.array([_number(time) for time in times], np.float64) for times in written]
    return Times(pieces, _step([time for times in written for time in times]), height * width)


def _repeat(raw: bytes, order: str, dotted: bool) -> float | None:
    """The median time between two events of one pixel, in the file's unit."""
    power = POWERS["s"] if dotted else 0
    x, y, t, *_ = parse_lines(np.frombuffer(raw, np.uint8), roles_of(order), power)
    repeat = repeat_of(x, y, t)
    return None if repeat is None else repeat / 10**power


def _step(written: list[str]) -> int | None:
    """The power of ten in whose steps the times are written; None for more places than a clock has."""
    powers: list[int] = []
    for time in written:
        try:
            _, digits, exponent = Decimal(time).normalize().as_tuple()
        except (InvalidOperation, Overflow):
            continue
        if digits != (0,) and isinstance(exponent, int):
            powers.append(exponent)
    step = min(powers, default=0)
    return None if step < -9 else min(step, 6)


def _no_numbers(path: Path, lines: bytes) -> BadFile:
    """The error for a text without numbers: no events yet, or another text."""
    said = [line.strip() for line in lines.decode(errors="replace").lstrip("\ufeff").splitlines() if line.strip()]
    prose = [line for line in said if line[0] not in "%#" and not named_columns(SPACES.split(line))]
    if not prose:
        return no_events_in(path)
    if not any(re.search(r"[^\W\d]", line) for line in prose):
        return BadFile(
            f"{path.name} holds no events: its lines, such as {prose[0][:60]!r}, are no t, x, y and p",
            fix="one event per line: time, column, row, polarity, between spaces, tabs, commas, semicolons or bars",
        )
    return BadFile(
        f"{path.name} is a text, such as a README, without a line of numbers `t x y p`: it begins {said[0][:60]!r}",
        fix="one event per line: time, column, row, polarity (0 and 1, or -1 and 1)",
    )
