"""Where an HDF5 file holds events: four arrays side by side, one array of fields, or one of four columns.

DSEC, TUM-VIE and M3ED have four arrays in a group, Prophesee an array of fields, MVSEC an array of columns. They are
found by the names of what they hold, wherever they lie.
"""

import re
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from evimo.arguments import size_of
from evimo.errors import BadFile, BadInput, MissingExtra
from evimo.formats.columns import LETTERS, check_lengths, found_columns, named_columns, sized_columns

ECF = 36559
IN_PLUGIN = {32001: "blosc", 32026: "blosc2", 32004: "LZ4", 32008: "bitshuffle", 32015: "Zstandard", 307: "bzip2"}
SAMPLE_ROWS = 5000


@dataclass(frozen=True, slots=True)
class EventTable:
    """One sensor's events in an open file.

    Their lengths are checked by `require_whole`, as those of another table do not matter.

    name:    where they lie, as users name it with --topic.
    columns: t, x, y, p: the array of each, and the field or column of that array; "" where the array is all its own.
    count:   how many events.
    """

    name: str
    columns: dict[str, tuple[Any, str | int]]
    count: int

    def stored(self, letters: str, first: int, last: int) -> list[NDArray[Any]]:
        """Columns of some events, as stored; an array that several of them lie in is read once."""
        read: dict[str, NDArray[Any]] = {}
        for letter in letters:
            array, part = self.columns[letter]
            if array.name not in read:
                lies = array.ndim == 2 and part == "" and array.shape[0] == 1  # as MATLAB's columns lie
                read[array.name] = array[0, first:last] if lies else array[first:last]
        return [self._column(read, letter) for letter in letters]

    def require_whole(self, path: Path) -> None:
        """Refuse arrays of unequal length.

        Raises:
            BadFile: they are.
        """
        check_lengths(path, {array.name: array.size for array, part in self.columns.values() if part == ""})

    def _column(self, read: dict[str, NDArray[Any]], letter: str) -> NDArray[Any]:
        array, part = self.columns[letter]
        whole = read[array.name]
        return whole[:, part] if isinstance(part, int) else whole[part] if part else whole.reshape(-1)


def event_tables(path: Path, file: h5py.File, columns: str | None) -> list[EventTable]:
    """Find all events in an open file, the most first.

    Raises:
        BadFile: there are none, or they are compressed with what is not there.
    """
    found, other, refused = list[EventTable](), list[str](), list[BadFile]()

    def look(name: str, there: Any) -> None:
        try:
            is_group = isinstance(there, h5py.Group)
            table = _of_group(name, there) if is_group else _of_array(path, name, there, columns)
        except BadFile as error:
            refused.append(error)
            return
        if table is not None:
            found.append(table)
        elif not is_group:
            other.append(f"{name} {there.shape}")

    look("", file)
    file.visititems(look)
    if not found and refused:
        raise refused[0]
    if not found:
        raise BadFile(
            f"{path.name} is HDF5 without events: {', '.join(other[:8]) or 'it is empty'}",
            fix="arrays t, x, y, p in one group, or one array `events` with fields or columns of these",
        )
    return sorted(found, key=lambda table: -table.count)


def _of_group(name: str, group: Any) -> EventTable | None:
    """Four arrays side by side."""
    arrays = [key for key in group if _is_column(group.get(key))]
    if (order := named_columns(arrays)) is None:
        return None
    columns: dict[str, tuple[Any, str | int]] = {letter: (group[arrays[order.index(letter)]], "") for letter in LETTERS}
    return EventTable(name or "/", columns, columns["t"][0].size)


def _is_column(there: Any) -> bool:
    """Whether an array holds one number for each event, along whichever axis."""
    if not isinstance(there, h5py.Dataset) or there.dtype.kind not in "iufb":
        return False
    return there.ndim == 1 or (there.ndim == 2 and 1 in there.shape)


def _of_array(path: Path, name: str, array: Any, said: str | None) -> EventTable | None:
    """One array of fields, or of four columns."""
    if array.dtype.names:
        order = named_columns(array.dtype.names) if array.ndim == 1 else None
        if order is None:
            return None
        fields = {letter: array.dtype.names[order.index(letter)] for letter in LETTERS}
        return EventTable(name, {letter: (array, field) for letter, field in fields.items()}, len(array))
    if array.ndim != 2 or not 4 <= array.shape[1] <= 8 or "event" not in name.lower() or array.dtype.kind not in "iuf":
        return None
    require_filters(path, array)
    if not len(array):
        return None
    parts = [array[at : at + SAMPLE_ROWS // 8] for at in np.linspace(0, len(array) - 1, 8).astype(int)]
    sample = np.concatenate(parts).astype(np.float64)
    order = sized_columns(said, array.shape[1]) if said else found_columns(path, sample)
    return EventTable(name, {letter: (array, order.index(letter)) for letter in LETTERS}, len(array))


def require_filters(path: Path, array: Any) -> None:
    """Load what an array is compressed with.

    Raises:
        MissingExtra: an extra has it. BadFile: Prophesee's codec, or an unknown one, is not installed.
    """
    properties = array.id.get_create_plist()
    numbers = [properties.get_filter(at)[0] for at in range(properties.get_nfilters())]
    for number in (number for number in numbers if not h5py.h5z.filter_avail(number)):
        if number in IN_PLUGIN:
            _load_plugin(path, IN_PLUGIN[number])
        if h5py.h5z.filter_avail(number):
            continue
        codec = "Prophesee's ECF codec" if number == ECF else f"the HDF5 filter {number}"
        raise BadFile(
            f"{path.name} is compressed with {codec}, which is not installed",
            fix="set HDF5_PLUGIN_PATH to the folder of its plugin (of Metavision: libhdf5_ecf_codec), or export as CSV",
        )


def _load_plugin(path: Path, codec: str) -> None:
    try:
        import_module("hdf5plugin")  # this registers the filters
    except ImportError as error:
        raise MissingExtra(
            f"{path.name} is compressed with {codec}, for which hdf5plugin is missing",
            extra="formats",
        ) from error


def beside(table: EventTable, name: str) -> Any:
    """What lies beside the events or above them by a name, as an attribute or an array; None where nothing does."""
    array = table.columns["t"][0]
    for place in (array, array.parent, array.parent.parent, array.file):
        if name in place.attrs:
            return place.attrs[name]
        if place is not array and isinstance(found := place.get(name), h5py.Dataset):
            return found[()]
    return None


def numbers_beside(table: EventTable, name: str) -> NDArray[Any] | None:
    """The numbers that lie so; None where what does is none."""
    found = np.asarray(beside(table, name))
    return found if found.dtype.kind in "iuf" else None


def stored_size(path: Path, table: EventTable) -> tuple[int, int] | None:
    """The sensor's size by `geometry`, `width` and `height`, `sensor_resolution`, or `calib/resolution`.

    Raises:
        BadFile: what they tell is no size.
    """
    if isinstance(written := beside(table, "geometry"), str | bytes):
        found = re.findall(r"\d+", written if isinstance(written, str) else written.decode(errors="replace"))
        return _size(path, "geometry", written, found[::-1])
    rows_first = [beside(table, side) for side in ("height", "width")]
    if all(np.size(each) == 1 and each is not None for each in rows_first):
        rows_first = [np.reshape(each, ()).item() for each in rows_first]
        return _size(path, "width and height", " ".join(map(str, rows_first[::-1])), rows_first)
    if np.shape(resolution := beside(table, "sensor_resolution")) == (2,):  # of e2vid and its relatives
        return _size(path, "sensor_resolution", resolution, list(resolution))
    if np.shape(resolution := beside(table, "calib/resolution")) == (2,):
        return _size(path, "calib/resolution", resolution, list(resolution[::-1]))
    return None


def _size(path: Path, name: str, written: Any, rows_first: list[Any]) -> tuple[int, int]:
    """(height, width) as they are written.

    Raises:
        BadFile: they are none.
    """
    try:
        return size_of(rows_first, name)
    except BadInput as error:
        text = f"{path.name}: its {name} {written!s} is no sensor size"
        raise BadFile(text, fix="give it with --sensor WxH") from error
