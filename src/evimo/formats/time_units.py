"""The unit of a recording's times: said by the user, or guessed and checked against what a camera can do.

Files of plain numbers rarely tell their unit. Each unit that they could be in is judged by what the recording would
then be: how many events a second and pixel, how soon a pixel sees its next one, in which steps its clock counts, when
it was made. The unit that such files usually have wins unless another one makes far more of a camera.
"""

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, EvimoWarning
from evimo.formats.clock_rules import MOST_US, NO_TIME, WINDOW_US

TimeUnit = Literal["s", "ms", "us", "ns"]

POWERS: dict[TimeUnit, int] = {"s": 6, "ms": 3, "us": 0, "ns": -3}  # of ten, from the unit to µs
NAMES: dict[TimeUnit, str] = {"s": "seconds", "ms": "ms", "us": "µs", "ns": "ns"}

# Events per second and pixel: hot scenes of large sensors reach some hundreds, dark ones a few hundredths,
# and a filter against noise leaves fewer.
USUAL_RATE, LEAST_RATE, MOST_RATE = 3.0, 0.0003, 3000.0
MOST_PER_SECOND = 5e9  # above the bandwidth of the fastest sensors
MOST_SECONDS = 7 * 86400.0
NO_LATER_S = 4.1e9  # the year 2100: no clock shows more
# Between two events of one pixel: the median is 4 to 120 ms in recordings of seven sensors, dark and bright.
USUAL_REPEAT_S, REPEAT_SPREAD = 0.015, 0.7  # the second in powers of ten
REPEATS, REPEAT_EVENTS, JUMPS = 100, 20_000, 20
ENOUGH = 50  # events that say something of a rate
CONVENTION = 1.5  # what the usual unit is worth, in squared powers of ten of the rate
FAR_LONGER = 100  # times as long as usual
DOUBT = 1.0  # as much as this between two units leaves both possible


@dataclass(frozen=True, slots=True)
class Times:
    """Times of a recording as its file writes them: some of its events, in pieces of the file's order.

    pieces: each a run of consecutive events, float64; nan where there is none.
    step:   power of ten of the steps in which they count, -3 for 0.001; None where rounding hides it.
    pixels: of the sensor, or of the part of it that sees events.
    repeat: the median time between two events of one pixel; None where there are too few.
    """

    pieces: Sequence[NDArray[np.float64]]
    step: int | None
    pixels: int
    repeat: float | None = None

    @property
    def first(self) -> float:
        """The time of an early event that is no outlier; nan where there is none."""
        return next((float(np.nanmedian(piece)) for piece in self.pieces if np.isfinite(piece).any()), math.nan)

    @property
    def count(self) -> int:
        """How many there are."""
        return sum(map(len, self.pieces))

    @property
    def rate(self) -> float:
        """Events per unit of time inside the pieces, the ends of each left out: outliers sort themselves there.

        A piece far longer than the others is left out: the clock starts again or wraps in it.
        """
        events, spans = list[int](), list[float]()
        for piece in self.pieces:
            ordered = np.sort(piece[np.isfinite(piece)])
            low, high = len(ordered) // 10, (len(ordered) - 1) * 9 // 10
            if high > low:
                events.append(high - low)
                spans.append(float(ordered[high] - ordered[low]))
        usual = float(np.median(spans)) if spans else 0.0
        kept = [(count, span) for count, span in zip(events, spans, strict=True) if span <= FAR_LONGER * usual]
        whole = sum(span for _, span in kept)
        return sum(count for count, _ in kept) / whole if whole > 0 else math.inf

    def in_no_order(self, window: float) -> bool:
        """Whether each piece holds times of the whole recording, beyond the window within which they are sorted."""
        pieces = [piece[np.isfinite(piece)] for piece in self.pieces]
        pieces = [piece for piece in pieces if len(piece) >= ENOUGH]
        if len(pieces) < 4 or np.concatenate([np.diff(piece) >= 0 for piece in pieces]).mean() > 0.75:
            return False
        low, middle, high = np.array([np.percentile(piece, (10, 50, 90)) for piece in pieces]).T
        length = float(np.median(high - low))
        return length > window and float(np.ptp(middle)) < 0.5 * length


def step_of(times: NDArray[Any]) -> int | None:
    """The power of ten in whose steps times count, 3 to -9; None for float32, and where rounding hides it."""
    if not len(times) or times.dtype == np.float32:
        return None
    if times.dtype.kind in "iu":
        return next((power for power in (6, 3) if not np.any(times.astype(np.int64) % 10**power)), 0)
    exact = np.asarray(times, np.float64)
    exact = exact[np.isfinite(exact)]
    if not len(exact):
        return None
    rounding = np.spacing(np.abs(exact).max()) * 4
    for power in (0, 3, 6, 9):
        scaled = exact * 10.0**power
        if rounding * 10.0**power > 0.01:
            return None
        if np.abs(scaled - np.rint(scaled)).max() <= max(rounding * 10.0**power, 1e-6):
            return -power
    return None


def repeat_of(x: NDArray[Any], y: NDArray[Any], t: NDArray[Any]) -> float | None:
    """The median time between two events of one pixel among the first ones; None where too few pixels see two."""
    x, y, t = (np.asarray(column[:REPEAT_EVENTS], np.float64) for column in (x, y, t))
    t = _without_jumps(t)
    order = np.lexsort((t, x, y))
    same = (np.diff(x[order]) == 0) & (np.diff(y[order]) == 0)
    between = np.diff(t[order])[same]
    between = between[between > 0]
    return float(np.median(between)) if len(between) >= REPEATS else None


def _without_jumps(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Times of which steps longer than nearly all others together are taken out: pauses, wraps, what is no time."""
    t = np.where(np.isfinite(t), t, np.nan)
    steps = np.nan_to_num(np.diff(t, prepend=t[:1]), nan=0.0)
    longest = np.sort(np.abs(steps))[: max(len(steps) - JUMPS, 0)].sum()
    if longest == 0:  # few times in all, as of frames: each step is one between two of them
        return t
    return t - np.cumsum(np.where(np.abs(steps) > longest, steps, 0.0))


def found_unit(path: Path, times: Times, *, said: TimeUnit | None, usual: TimeUnit) -> TimeUnit:
    """The unit of a file's times; a warning says so where it is not the usual one, or may be another.

    Raises:
        BadFile: in no unit are they those of a camera.
    """
    if not any(np.isfinite(piece).any() for piece in times.pieces):
        raise BadFile(f"{path.name}: none of its times is a number", fix="export the recording again")
    if said is not None:
        if not is_plausible(times, said):
            text = f"{path.name}: {in_words(times, said)}: no camera does that"
            warnings.warn(f"{text}; --time-unit {said} may not be their unit", EvimoWarning, stacklevel=4)
        return said
    if times.in_no_order(WINDOW_US / 10.0 ** POWERS[usual]):
        raise BadFile(
            f"{path.name}: its times are in no order: each part of it holds those of all",
            fix="sort the recording by time",
        )
    known: list[TimeUnit] = [unit for unit in POWERS if is_plausible(times, unit)]
    if not known:
        raise BadFile(f"{path.name}: {in_words(times, usual)}: no camera does that", fix=FIX)
    costs: dict[TimeUnit, float] = {unit: _cost(times, unit) + (0 if unit == usual else CONVENTION) for unit in known}
    known.sort(key=lambda unit: costs[unit])
    unit, others = known[0], known[1:]
    in_doubt = times.count >= ENOUGH and not math.isinf(times.rate)
    if unit != usual or (in_doubt and others and costs[others[0]] < costs[unit] + DOUBT):
        other = usual if unit != usual else others[0]
        why = f"{in_words(times, unit)}; {in_words(times, other)}" if in_doubt else "by their dates and digits"
        text = f"{path.name}: times are taken as {NAMES[unit]} ({why})"
        warnings.warn(f"{text}; --time-unit sets their unit", EvimoWarning, stacklevel=4)
    return unit


FIX = "give the unit of its times with --time-unit s, ms, us or ns; and the order of columns with --columns, as in txyp"


def is_plausible(times: Times, unit: TimeUnit) -> bool:
    """Whether a camera can have such times in such a unit; of few events only their date says anything."""
    to_s = 10.0 ** (POWERS[unit] - 6)
    if not abs(times.first * to_s) <= NO_LATER_S:
        return False
    if times.count < ENOUGH or math.isinf(times.rate):
        return True
    per_s = times.rate / to_s
    return per_s <= MOST_PER_SECOND and LEAST_RATE <= per_s / times.pixels <= MOST_RATE


def _cost(times: Times, unit: TimeUnit) -> float:
    """How far a recording in such a unit is from a usual one, in squared powers of ten."""
    steps = 0.0
    if times.step is not None:
        off = times.step + POWERS[unit]  # cameras count microseconds
        steps = abs(off) / 3 if off > 0 else min(abs(off) / 2, 1.5)
    if times.count < ENOUGH or math.isinf(times.rate):
        return steps / 2
    to_s = 10.0 ** (POWERS[unit] - 6)
    cost = math.log10(times.rate / to_s / times.pixels / USUAL_RATE) ** 2 + steps
    if times.repeat is not None:
        cost += (math.log10(times.repeat * to_s / USUAL_REPEAT_S) / REPEAT_SPREAD) ** 2
    return cost


def in_words(times: Times, unit: TimeUnit) -> str:
    """Return what a recording would be like in a unit."""
    per_s = times.rate / 10.0 ** (POWERS[unit] - 6)
    return f"in {NAMES[unit]} there would be {per_s:.3g} events a second, {per_s / times.pixels:.2g} per pixel"


def check_span(path: Path, *, events: int, span_us: int, unit: TimeUnit) -> None:
    """Refuse a recording whose guessed unit makes it last longer than cameras record.

    Raises:
        BadFile: its events are more than a week apart, or fewer than one an hour.
    """
    span_s = span_us * 1e-6
    if events >= ENOUGH and (span_s > MOST_SECONDS or span_s > 3600 * events):
        raise BadFile(f"{path.name}: its {events:,} events would last {span_s:,.0f} s in {NAMES[unit]}", fix=FIX)


def as_us(times: NDArray[Any], unit: TimeUnit) -> NDArray[np.int64]:
    """Times in whole µs, rounded; what is no number, or too large for a clock, gets the time that is none."""
    power = POWERS[unit]
    if times.dtype.kind in "iu":
        return _whole_as_us(times, power)
    us = np.asarray(times, np.float64) * 10.0**power if power >= 0 else np.asarray(times, np.float64) / 10.0**-power
    if us.size and us.min() > -MOST_US and us.max() < MOST_US:  # as nearly always
        return np.rint(us).astype(np.int64)
    with np.errstate(invalid="ignore"):
        inside = np.abs(us) < MOST_US
        return np.where(inside, np.rint(np.where(inside, us, 0)), NO_TIME).astype(np.int64)


def _whole_as_us(times: NDArray[Any], power: int) -> NDArray[np.int64]:
    if power < 0:
        return (times.astype(np.int64) + 10**-power // 2) // 10**-power
    us = times.astype(np.int64)
    inside = (us > -(MOST_US // 10**power)) & (us < MOST_US // 10**power)
    return np.where(inside, np.where(inside, us, 0) * 10**power, NO_TIME)
