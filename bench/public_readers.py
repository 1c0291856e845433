"""Readers that others publish, for the table of `readers.py`: the fastest that pip installs for each format.

Each is optional: `pip install --target DIR faery evutils evt3 expelliarmus aedat`, then `PYTHONPATH=DIR`.
Each function reads a whole file and gives the number of its events.
"""

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any


def faery(path: Path) -> int:
    """In packets, as they come."""
    library: Any = importlib.import_module("faery")
    return sum(len(packet) for packet in library.events_stream_from_file(path))


def evutils(path: Path) -> int:
    """In its own chunks."""
    library: Any = importlib.import_module("evutils.io")
    with library.EventReader(path) as reader:
        return sum(len(chunk) for chunk in reader)


def evt3(path: Path) -> int:
    """Whole."""
    library: Any = importlib.import_module("evt3")
    return len(library.decode_file(str(path)))


def expelliarmus(path: Path) -> int:
    """In chunks of 100,000 events, as it reads files that do not fit in memory."""
    library: Any = importlib.import_module("expelliarmus")
    encoding = "dat" if path.suffix == ".dat" else path.stem
    wizard = library.Wizard(encoding=encoding, fpath=str(path), chunk_size=100_000)
    return sum(len(chunk) for chunk in wizard.read_chunk())


def aedat(path: Path) -> int:
    """Packet by packet."""
    library: Any = importlib.import_module("aedat")
    return sum(len(packet["events"]) for packet in library.Decoder(path) if "events" in packet)


def dv_processing(path: Path) -> int:
    """Batch by batch, with the columns of each."""
    library: Any = importlib.import_module("dv_processing")
    recording, count = library.io.MonoCameraRecording(str(path)), 0
    while recording.isRunning():
        if (batch := recording.getNextEventBatch()) is not None:
            count += len(batch.numpy())
    return count


# By the beginning of the format's name in the table.
READERS: dict[str, tuple[Callable[[Path], int], ...]] = {
    "RAW, EVT 2.0": (faery, evutils, expelliarmus),
    "RAW, EVT 2.1": (evutils,),
    "RAW, EVT 3": (faery, evutils, evt3, expelliarmus),
    "DAT": (faery, evutils, expelliarmus),
    "AEDAT 4": (faery, aedat, dv_processing),
    "Event Stream": (faery,),
}


def readers_of(name: str) -> tuple[Callable[[Path], int], ...]:
    """Those for a format of the table."""
    return next((found for start, found in READERS.items() if name.startswith(start)), ())
