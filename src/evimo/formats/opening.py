"""Open a recording of any format: recognise it by its content, then by its suffix."""

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

from evimo.arguments import path_of, size_of, word_of
from evimo.errors import BadFile, BadInput, EvimoWarning
from evimo.formats.columns import said_columns
from evimo.formats.event_file import EventFile
from evimo.formats.recognition import SUFFIXES, Kind, recognised
from evimo.formats.time_units import POWERS, TimeUnit

KEPT_BYTES = 1 << 24
# What the reader of each kind asks for besides the sensor, as keywords.
OPTIONS: dict[Kind, set[str]] = {
    "evimo_npz": {"time_unit", "columns"},
    "evimo2": {"time_unit"},
    "hdf5": {"time_unit", "columns", "topic"},
    "aedat3": {"topic"},
    "aedat4": {"topic"},
    "rosbag1": {"topic"},
    "rosbag2": {"topic"},
    "text": {"time_unit", "columns"},
}


def open_events(
    path: str | Path,
    *,
    sensor: tuple[int, int] | None = None,
    time_unit: TimeUnit | None = None,
    columns: str | None = None,
    topic: str | None = None,
) -> EventFile:
    """Open an event recording: packets in constant memory, sensor size, time range, seeking.

    Args:
        path: a file, or an EVIMO2 folder.
        sensor: (height, width) in px where the file does not tell; it overrides a file that does.
        time_unit: s, ms, us or ns, where times are plain numbers; guessed and checked by default.
        columns: the order of a table's columns, a letter each, as in "txyp"; _ leaves one out.
        topic: of the events, in a file that holds those of several cameras.

    Raises:
        NotFound: there is nothing at `path`.
        BadFile: it is no event recording that can be read; the message says what it is.
        BadInput: an option is not what it may be.
    """
    path = path_of(path, "a recording")
    sensor = None if sensor is None else size_of(sensor, "sensor")
    if time_unit not in (None, *POWERS):
        raise BadInput(f"times in {time_unit!r}", fix=f"time_unit is one of {', '.join(POWERS)}")
    _check_words(columns, topic)
    kind = recognised(path)
    _keep_memory()
    options = {"time_unit": time_unit, "columns": columns, "topic": topic}
    recording = _opener(kind)(path, sensor, **_used(path, kind, options))
    _check_sensor(recording)
    suffix = path.suffix.lower()
    if path.is_file() and suffix not in SUFFIXES[kind]:
        text = f"{path.name} holds {_title(kind)} by its content: its suffix {suffix or '(none)'!r} is ignored"
        warnings.warn(text, EvimoWarning, stacklevel=2)
    return recording


def _check_words(columns: object, topic: object) -> None:
    if columns is not None:
        said_columns(word_of(columns, "columns", fix="their letters in order, as in 'txyp'"))
    if topic is not None:
        word_of(topic, "topic", fix="its name, as `evimo info` lists it")


def _check_sensor(recording: EventFile) -> None:
    try:
        size_of(recording.sensor, f"the sensor that {recording.path.name} tells of")
    except BadInput as error:
        raise BadFile(error.problem, fix="give its size with --sensor WxH") from error


def _opener(kind: Kind) -> Callable[..., EventFile]:
    """The function that opens recordings of a kind."""
    match kind:
        case "evimo_npz":
            from evimo.formats.evimo_npz import open_evimo_npz as opened
        case "evimo2":
            from evimo.formats.evimo2 import open_evimo2 as opened
        case "hdf5":
            from evimo.formats.hdf5 import open_hdf5 as opened
        case "aedat2":
            from evimo.formats.aedat2 import open_aedat2 as opened
        case "aedat3":
            from evimo.formats.aedat3 import open_aedat3 as opened
        case "aedat4":
            from evimo.formats.aedat4 import open_aedat4 as opened
        case "event_stream":
            from evimo.formats.event_stream import open_event_stream as opened
        case "rosbag1":
            from evimo.formats.bags import open_rosbag1 as opened
        case "rosbag2":
            from evimo.formats.bags import open_rosbag2 as opened
        case "prophesee_raw":
            from evimo.formats.prophesee_raw import open_prophesee_raw as opened
        case "prophesee_dat":
            from evimo.formats.prophesee_dat import open_prophesee_dat as opened
        case _:
            from evimo.formats.text import open_text as opened
    return opened


def _keep_memory() -> None:
    """Have the C library keep pieces of memory that are given back, for those that are asked for next.

    Otherwise it returns those of a block's size to the system and fetches them anew, page by page, with every block:
    AEDAT 4 takes three times as long. It keeps pieces up to the size of the largest that was given back.
    """
    np.empty(KEPT_BYTES, np.uint8)


def _used(path: Path, kind: Kind, options: dict[str, str | None]) -> dict[str, str]:
    """The options that were given and mean something for files of this kind; of the others a warning says so."""
    given = {name: value for name, value in options.items() if value is not None}
    for name in given.keys() - OPTIONS.get(kind, set()):
        text = f"{path.name} holds {_title(kind)}: --{name.replace('_', '-')} means nothing for it and is ignored"
        warnings.warn(text, EvimoWarning, stacklevel=3)
    return {name: value for name, value in given.items() if name in OPTIONS.get(kind, set())}


def _title(kind: Kind) -> str:
    titles = {
        "evimo_npz": "a NumPy archive",
        "evimo2": "an EVIMO2 folder",
        "hdf5": "HDF5",
        "aedat2": "an AEDAT 2 recording",
        "aedat3": "an AEDAT 3 recording",
        "aedat4": "an AEDAT 4 recording",
        "event_stream": "an Event Stream",
        "rosbag1": "a ROS 1 bag",
        "rosbag2": "a ROS 2 bag",
        "prophesee_raw": "a Prophesee RAW recording",
        "prophesee_dat": "a Prophesee DAT recording",
    }
    return titles.get(kind, "text events")
