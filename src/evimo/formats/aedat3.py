"""AEDAT 3, as cAER and early DV software record it: packets of events, frames and IMU samples."""

import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from evimo.errors import BadFile
from evimo.events.events import Events
from evimo.formats.event_file import EventFile
from evimo.formats.event_record_kernel import KINDS, UNKNOWN, decode_aedat3
from evimo.formats.sensors import assumed_sensor
from evimo.formats.survey import surveyed
from evimo.formats.word_file import WordFile

LONGEST_BYTES = 1 << 20
LINE = re.compile(rb"#[\t\x20-\x7e\x80-\xff]*\r?\n")
END = b"#!END-HEADER"
SIZES = {
    "DVS128": (128, 128),
    "DAVIS128": (128, 128),
    "DAVIS208": (192, 208),
    "DAVIS240": (180, 240),
    "DAVIS346": (260, 346),
    "DAVIS640": (480, 640),
    "DVXPLORERLITE": (240, 320),
    "DVXPLORER": (480, 640),
}
CONTENTS = {"signals": 0, "frames": 2, "IMU (6 axes)": 3, "IMU (9 axes)": 4}


def open_aedat3(path: Path, sensor: tuple[int, int] | None = None) -> EventFile:
    """Open an AEDAT 3.0 or 3.1 recording; its events count rows from the top, as ours do.

    Raises:
        BadFile: packed in another way than plain, or without events.
    """
    length, text = _header(path)
    packing = re.search(r"^#Format: *(\S+)", text, re.MULTILINE)
    if packing and packing[1].upper() not in ("RAW", "PNGFRAMES"):
        raise BadFile(f"{path.name} is AEDAT 3 packed as {packing[1]}", fix="record or export it with the format RAW")
    kinds = np.zeros(KINDS, np.int64)
    start = length, np.array([0, UNKNOWN])
    survey = surveyed(path, _packets(path, length, kinds).blocks(start))
    packets = _packets(path, length, np.zeros(KINDS, np.int64))

    def read(start_us: int) -> Iterator[Events]:
        return (events for _, events in packets.blocks(survey.place(start_us)))

    return EventFile(
        path=path,
        format="AEDAT 3",
        sensor=sensor or _size(text) or assumed_sensor(path, survey.extent),
        start_us=survey.start_us,
        stop_us=survey.stop_us,
        read=read,
        contents={name: f"{kinds[kind]:,}" for name, kind in CONTENTS.items() if kinds[kind]},
    )


def _packets(path: Path, offset: int, kinds: np.ndarray[tuple[int], np.dtype[np.int64]]) -> WordFile:
    decode: Any = partial(decode_aedat3, kinds=kinds)
    return WordFile(path, offset, np.dtype("u1"), decode)


def _header(path: Path) -> tuple[int, str]:
    """Bytes until the first packet, and the lines before it."""
    with path.open("rb") as file:
        raw = file.read(LONGEST_BYTES)
    at = 0
    while match := LINE.match(raw, at):
        at = match.end()
        if match[0].startswith(END):
            break
    return at, raw[:at].decode("latin-1")


def _size(text: str) -> tuple[int, int] | None:
    """(height, width) of the camera that the header names."""
    names = re.findall(r"^#Source +\d+: *(\S+)", text, re.MULTILINE)
    found = (size for name in names for known, size in SIZES.items() if name.upper().startswith(known))
    return next(found, None)
