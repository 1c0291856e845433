"""Write events alone, in the formats of the sensors' makers: AEDAT 4 (iniVation) and RAW (Prophesee, EVT 2.0)."""

import errno
import importlib
import subprocess
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadInput, MissingExtra
from evimo.events.events import Events
from evimo.formats import aedat4_process
from evimo.writing import new_file

CD_ON, TIME_HIGH = 1 << 28, 8 << 28
TIME_LOW_BITS, TIME_HIGH_BITS, X_BITS = 6, 28, 11
RAW_LARGEST = 1 << X_BITS  # px


def check_events_format(name: str, size: tuple[int, int]) -> None:
    """Say before anything is simulated what would fail afterwards.

    Raises:
        BadInput: no such format, or it cannot hold a sensor of this size. MissingExtra: its library is missing.
    """
    if name not in SAVE:
        raise BadInput(f"no events format {name!r}", fix=f"one of {', '.join(SAVE)}")
    if name == "raw" and max(size) > RAW_LARGEST:
        raise BadInput(f"RAW (EVT 2.0) cannot hold {size[1]}x{size[0]} px", fix=f"at most {RAW_LARGEST} px each way")
    if name == "aedat4":
        _dv_processing()


def save_events(packets: Iterable[Events], path: Path, *, size: tuple[int, int]) -> None:
    """Write packets of events to a new file, in the format that its suffix names; beside it first, then renamed.

    Args:
        packets: sorted by time, from 0 µs on. size: height and width of the sensor, px.

    Raises:
        BadInput: it cannot be written, or the disk is full.
    """
    with new_file(path) as unfinished:
        SAVE[path.suffix.removeprefix(".")](packets, unfinished, size)


def save_aedat4(packets: Iterable[Events], path: Path, size: tuple[int, int]) -> None:
    """Write AEDAT 4 with LZ4, through dv-processing, which takes events one by one: about 0.7 million per second.

    Raises:
        OSError: the process that writes has ended, as it does when the disk is full.
    """
    _dv_processing()
    command = [sys.executable, "-P", aedat4_process.__file__, str(path), str(size[1]), str(size[0])]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.DEVNULL)
    with suppress(BrokenPipeError), process:
        assert process.stdin is not None
        for packet in filter(len, packets):
            process.stdin.write(len(packet).to_bytes(8, "little"))
            for column, kind in zip((packet.t, packet.x, packet.y, packet.p), aedat4_process.COLUMNS, strict=True):
                process.stdin.write(column.astype(kind, copy=False).tobytes())
        process.stdin.write((-1).to_bytes(8, "little", signed=True))
    if process.returncode:
        raise OSError(errno.EIO, "the disk is full, or cannot be written any more", str(path))


def save_raw(packets: Iterable[Events], path: Path, size: tuple[int, int]) -> None:
    """Write Prophesee RAW in EVT 2.0: a word of 32 bits per event, and one more where the upper bits of time change."""
    place = f"height={size[0]};width={size[1]}"
    lines = ("evt 2.0", f"format EVT2;{place}", f"geometry {size[1]}x{size[0]}", "end")
    with path.open("wb") as file:
        file.write("".join(f"% {line}\n" for line in lines).encode())
        high = -1
        for packet in filter(len, packets):
            file.write(evt2_words(packet, high).tobytes())
            high = int(packet.t[-1]) >> TIME_LOW_BITS


def evt2_words(events: Events, high: int) -> NDArray[np.uint32]:
    """EVT 2.0 of events, at least one, that follow an event whose time, without its low 6 bits, was `high`.

    From the top: 4 bits type, 6 bits of time (µs), 11 bits x, 11 bits y; or the type and 28 upper bits of time, which
    start over after 4.7 hours.
    """
    highs = events.t >> TIME_LOW_BITS
    changes = np.diff(highs, prepend=high) != 0
    low = (events.t & ((1 << TIME_LOW_BITS) - 1)) << (2 * X_BITS)
    kind = np.where(events.p > 0, CD_ON, 0)
    words = np.empty(len(events) + int(changes.sum()), "<u4")
    at = np.arange(len(events)) + np.cumsum(changes)
    words[at] = kind | low | (events.x.astype(np.int64) << X_BITS) | events.y
    words[at[changes] - 1] = TIME_HIGH | (highs[changes] & ((1 << TIME_HIGH_BITS) - 1))
    return words


def _dv_processing() -> Any:
    try:
        return importlib.import_module("dv_processing")
    except ImportError as error:
        raise MissingExtra("AEDAT 4 is written through dv-processing", extra="formats") from error


SAVE = {"aedat4": save_aedat4, "raw": save_raw}
