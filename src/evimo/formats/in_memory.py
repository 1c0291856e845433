"""Events that lie in memory, as a recording like any other."""

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from evimo.arguments import size_of
from evimo.errors import BadInput, EvimoWarning
from evimo.events.events import Events
from evimo.formats.event_file import EventFile
from evimo.formats.sensors import assumed_sensor, size_in_words
from evimo.formats.time_units import Times, in_words, is_plausible

PACKET = 1 << 16  # events handed out at once
BEYOND = {"x": 2**16, "y": 2**16, "t": 2**62}
POLARITY_NAMES = ("p", "polarity", "on")
COLUMNS = (
    "evimo.Events, an array with fields t, x, y and p, or an array (N, 4) whose columns are t, x, y, p; t in µs; "
    "what lists, tensors and tables hold becomes one by numpy.asarray"
)
PIECE = 10_000  # events of which the rate is looked at together


def recording_of(events: Events | NDArray[Any], *, sensor: tuple[int, int] | None = None) -> EventFile:
    """Return a recording whose events lie in memory; they are copied only where their types have to change.

    Args:
        events: `Events`, a structured array with fields t, x, y and p (or polarity, or on), or an array (N, 4) whose
            columns are t, x, y and p. Times are whole µs; polarities are -1 or 0, and 1.
        sensor: (height, width) in px; without it the smallest known sensor that holds all events, with a warning.

    Raises:
        BadInput: it is none of these, or a column is of another length, or holds what it cannot; or there are none; or
            some lie outside the sensor.
    """
    checked = _sorted(_events(events))
    path = Path("events in memory")
    extent = int(checked.y.max()) + 1, int(checked.x.max()) + 1
    size = assumed_sensor(path, extent) if sensor is None else _holding(size_of(sensor, "sensor"), extent)
    _warn_of_times(checked, size)

    def read(start_us: int) -> Iterator[Events]:
        for first in range(int(np.searchsorted(checked.t, start_us)), len(checked), PACKET):
            yield checked.part(first, first + PACKET)

    return EventFile(
        path=path,
        format="in memory",
        sensor=size,
        start_us=int(checked.t[0]),
        stop_us=int(checked.t[-1]) + 1,
        read=read,
    )


def _events(given: object) -> Events:
    if isinstance(given, Events):
        columns = {"t": given.t, "x": given.x, "y": given.y, "p": given.p}
    elif isinstance(given, np.ndarray) and given.dtype.names is not None:
        columns = _fields(cast(NDArray[Any], given))
    elif isinstance(given, np.ndarray) and given.ndim == 2 and given.shape[1] == 4:
        columns = dict(zip("txyp", cast(NDArray[Any], given).T, strict=True))
    else:
        shape = f" {given.shape}" if isinstance(given, np.ndarray) else ""
        raise BadInput(f"{type(given).__name__}{shape} holds no events", fix=COLUMNS)
    if any(np.ma.is_masked(column) for column in columns.values()):
        raise BadInput("some values of the events are masked", fix="leave these events out: rows[~rows.mask.any(1)]")
    arrays = {name: np.asarray(column) for name, column in columns.items()}
    lengths = {name: array.shape for name, array in arrays.items()}
    if len(set(lengths.values())) > 1 or arrays["t"].ndim != 1:
        raise BadInput(f"the columns of the events do not fit together: {lengths}", fix=COLUMNS)
    if not arrays["t"].size:
        raise BadInput("there are no events", fix="at least one slice of 25 ms of them")
    t = _whole(arrays["t"], "t").astype(np.int64, copy=False)
    x, y = (_whole(arrays[name], name).astype(np.uint16, copy=False) for name in "xy")
    return Events(x, y, t, _polarity(arrays["p"]))


def _fields(given: NDArray[Any]) -> dict[str, NDArray[Any]]:
    names = given.dtype.names or ()
    polarity = next((name for name in POLARITY_NAMES if name in names), None)
    if polarity is None or not {"t", "x", "y"} <= set(names):
        raise BadInput(f"an array with fields {', '.join(names)} holds no events", fix=COLUMNS)
    return {"t": given["t"], "x": given["x"], "y": given["y"], "p": given[polarity]}


def _whole(column: NDArray[Any], name: str) -> NDArray[Any]:
    """Return the column, if all its numbers are whole and none is out of range."""
    if column.dtype.kind not in "iuf":
        raise BadInput(f"column {name} of the events is {column.dtype}", fix="whole numbers")
    if column.dtype.kind == "f":
        column = _exact(column, name)
    with np.errstate(invalid="ignore"):
        wrong = ~((column >= 0) & (column < BEYOND[name]))
        if column.dtype.kind == "f":
            wrong |= column != np.rint(column)
    if wrong.any():
        first = int(np.argmax(wrong))
        fix = "times in whole µs: seconds times 1e6, rounded" if name == "t" else "columns and rows from 0"
        count = f"{int(wrong.sum()):,} of {column.size:,}"
        raise BadInput(f"column {name} holds {column[first]!s} at place {first} ({count} such values)", fix=fix)
    return column


def _exact(column: NDArray[Any], name: str) -> NDArray[np.float64]:
    """Return the column in float64, unless its own type has rounded what it holds."""
    most = 2 ** (np.finfo(column.dtype).nmant + 1)
    exact = column.astype(np.float64, copy=False)
    if name == "t" and most < exact.max() < BEYOND[name]:
        raise BadInput(
            f"column t is {column.dtype}, which has no whole numbers beyond {most:,}", fix="times as int64 or float64"
        )
    return exact


def _polarity(column: NDArray[Any]) -> NDArray[np.int8]:
    wrong = ~np.isin(column, (-1, 0, 1))
    if wrong.any():
        raise BadInput(f"column p holds {column[np.argmax(wrong)]!s}", fix="1 for brighter, and 0 or -1 for darker")
    return np.where(column > 0, np.int8(1), np.int8(-1))


def _holding(sensor: tuple[int, int], extent: tuple[int, int]) -> tuple[int, int]:
    """Return the sensor, if it holds so many rows and columns."""
    if extent[0] <= sensor[0] and extent[1] <= sensor[1]:
        return sensor
    turned = "; sizes are (height, width)" if extent[0] <= sensor[1] and extent[1] <= sensor[0] else ""
    raise BadInput(
        f"events reach column {extent[1] - 1} and row {extent[0] - 1}, beyond a sensor of {size_in_words(sensor)}",
        fix=f"the sensor or the camera that saw them, or leave out what is beyond it{turned}",
    )


def _warn_of_times(events: Events, sensor: tuple[int, int]) -> None:
    """Say so where times are of no camera in µs, which they are taken as."""
    firsts = np.linspace(0, max(len(events) - PIECE, 0), 8).astype(int).tolist()
    pieces = [events.t[first : first + PIECE].astype(np.float64) for first in firsts]
    times = Times(pieces, step=None, pixels=sensor[0] * sensor[1])
    if not is_plausible(times, "us"):
        text = f"events in memory: {in_words(times, 'us')}, as of no camera: are their times in µs?"
        warnings.warn(text, EvimoWarning, stacklevel=4)


def _sorted(events: Events) -> Events:
    late = int(np.count_nonzero(events.t < np.maximum.accumulate(events.t)))
    if not late:
        return events
    warnings.warn(f"{late:,} events were out of order and sorted", EvimoWarning, stacklevel=4)
    order = np.argsort(events.t, kind="stable")
    return Events(events.x[order], events.y[order], events.t[order], events.p[order])
