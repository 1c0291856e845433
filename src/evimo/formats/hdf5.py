"""HDF5 recordings: DSEC, TUM-VIE, M3ED, MVSEC, Prophesee, and others that name their arrays or columns t, x, y, p."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile
from evimo.events.events import Events
from evimo.formats.choosing import chosen_of, listed
from evimo.formats.columns import check_pixels, check_polarities, signs
from evimo.formats.event_file import EventFile
from evimo.formats.hdf5_file import opened_hdf5
from evimo.formats.hdf5_tables import EventTable, event_tables, numbers_beside, require_filters, stored_size
from evimo.formats.sensors import assumed_sensor, extent_of, fitting_sensor, upright, whole_pixels
from evimo.formats.stored_times import PIECE_EVENTS, PIECES, StoredTimes
from evimo.formats.survey import no_events_in
from evimo.formats.time_units import NAMES, REPEAT_EVENTS, TimeUnit, repeat_of

PACKET_EVENTS = 1 << 17
CUT = "copy or download it again"


def open_hdf5(
    path: Path,
    sensor: tuple[int, int] | None = None,
    *,
    time_unit: TimeUnit | None = None,
    columns: str | None = None,
    topic: str | None = None,
) -> EventFile:
    """Open the events of one camera: those of `topic`, a part of their name such as left, else the most.

    Times are usually µs where they are stored as whole numbers, seconds where not; `t_offset` is added. `ms_to_idx`
    is where reading starts, if the file has it.

    Raises:
        BadFile: damaged, without events, or compressed with what is not installed. NotFound: no such topic.
    """
    try:
        file = opened_hdf5(path)
        tables = event_tables(path, file, columns)
        table = tables[chosen_of(path, [each.name for each in tables], topic)]
        table.require_whole(path)
        for array, _ in table.columns.values():
            require_filters(path, array)
        if not table.count:
            raise no_events_in(path)
        reader = _Reader(path, table, said=time_unit, sensor=sensor)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:  # as h5py has it of damaged files
        raise BadFile(f"{path.name} is HDF5, but damaged or cut short: {error}", fix=CUT) from error
    return EventFile(
        path=path,
        format=f"HDF5, {table.name} (times in {NAMES[reader.times.unit]})",
        sensor=reader.sensor,
        start_us=reader.times.start_us,
        stop_us=reader.times.stop_us,
        read=reader.packets,
        contents={"topics": listed([f"{each.name} ({each.count:,} events)" for each in tables])},
        topic=table.name if len(tables) > 1 else "",
    )


class _Reader:
    """Packets of one table, from any time on."""

    def __init__(self, path: Path, table: EventTable, *, said: TimeUnit | None, sensor: tuple[int, int] | None) -> None:
        self._path, self._table = path, table
        *first, polarities = self._stored("xytp", 0, REPEAT_EVENTS)
        check_polarities(path, polarities)
        check_pixels(path, *first[:2])
        extent = (1, 1) if sensor else self._extent()
        size = sensor or upright(path, stored_size(path, table), extent)
        height, width = size or fitting_sensor(extent)
        self.times = StoredTimes(
            path,
            lambda start, stop: self._stored("t", start, stop)[0],
            count=table.count,
            pixels=height * width,
            repeat=repeat_of(*first),
            said=said,
            offset=_offset(path, table),
        )
        index = numbers_beside(table, "ms_to_idx")
        self._index = numbers_beside(table, "ms_map_idx") if index is None else index
        self.sensor = size or assumed_sensor(path, extent)

    def packets(self, start_us: int) -> Iterator[Events]:
        """Packets from a place at or before a time."""
        for at in range(self._place(start_us), self._table.count, PACKET_EVENTS):
            t, x, y, p = self._stored("txyp", at, min(at + PACKET_EVENTS, self._table.count))
            yield Events(whole_pixels(x), whole_pixels(y), self.times.in_us(t), signs(p))

    def _place(self, start_us: int) -> int:
        """By the file's own index of milliseconds, 50 of them earlier for what is out of order; else by halving.

        An index that does not fit the times, as one that was copied from another file, is not used.
        """
        millisecond = (start_us - self.times.offset_us) // 1000 - 50
        if self._index is None or self._index.ndim != 1 or not len(self._index) or self._index.dtype.kind == "f":
            return self.times.place(start_us)
        at = int(self._index[min(millisecond, len(self._index) - 1)]) if millisecond > 0 else 0
        if at == 0:
            return 0
        fits = 0 < at < self._table.count and self.times.between(at - 1, at)[0] < start_us
        return at if fits else self.times.place(start_us)

    def _extent(self) -> tuple[int, int]:
        """One more than the largest row and column among events from all over the file."""
        height, width = 1, 1
        for at in np.linspace(0, max(self._table.count - PIECE_EVENTS, 0), PIECES).astype(int).tolist():
            x, y = (whole_pixels(each) for each in self._stored("xy", at, at + PIECE_EVENTS))
            width, height = max(width, extent_of(x)), max(height, extent_of(y))
        return height, width

    def _stored(self, letters: str, first: int, last: int) -> list[NDArray[Any]]:
        try:
            return self._table.stored(letters, first, min(last, self._table.count))
        except (OSError, RuntimeError) as error:
            raise BadFile(f"{self._path.name} is damaged near event {first:,}: {error}", fix=CUT) from error


def _offset(path: Path, table: EventTable) -> float:
    """What is to be added to all times.

    Raises:
        BadFile: it is no number.
    """
    offset = numbers_beside(table, "t_offset")
    if offset is None:
        return 0
    if offset.size != 1 or not np.isfinite(offset).all():
        raise BadFile(f"{path.name}: its t_offset {offset.tolist()!s:.40} is no number", fix="export it again")
    return offset.reshape(-1)[0].item()
