"""Prophesee DAT: events of 8 bytes after a header of text, as their older tools and data sets store them."""

from functools import partial
from pathlib import Path

import numpy as np

from evimo.errors import BadFile
from evimo.formats.clock_rules import NO_TIME
from evimo.formats.event_file import EventFile
from evimo.formats.event_record_kernel import decode_dat
from evimo.formats.prophesee_header import Header, header, sample
from evimo.formats.word_file import WordFile, open_words

CHANGES = (0x00, 0x0C)  # types of event that are changes of brightness
OTHERS = {0x01: "exposure measurements", 0x0D: "monitoring", 0x0E: "triggers"}
BITS = {1: (9, 8, 17), 2: (14, 14, 28)}  # of column and row, and where the polarity is, by version


def open_prophesee_dat(path: Path, sensor: tuple[int, int] | None = None) -> EventFile:
    """Open a DAT file of version 1 or 2; its times, of 32 bits, go on where they wrap, after 72 minutes.

    Raises:
        BadFile: of other events, another version, cut short inside its header, or without events.
    """
    head = header(path)
    version = _version(path, head)
    _check_kind(path, head.length)
    events = WordFile(path, head.length + 2, np.dtype(("<u4", (2,))), partial(decode_dat, bits=BITS[version]))
    size = sensor or head.size()
    return open_words(events, np.full(1, NO_TIME), title=f"Prophesee DAT {version}", size=size, holds="an event")


def _version(path: Path, head: Header) -> int:
    """The version by the header; where that is silent, 1 if no event has more bits than it has.

    Raises:
        BadFile: another.
    """
    told = head.fields.get("Version")
    if told is None:
        raw = sample(path, head.length + 2)
        addresses = np.frombuffer(raw, "<u4", len(raw) // 8 * 2)[1::2]
        return 2 if np.any(addresses >> BITS[1][2] + 1) else 1
    if told.removesuffix(".0") not in {str(version) for version in BITS}:
        raise BadFile(f"{path.name} is DAT version {told}; 1 and 2 are read", fix="export it again, as RAW or CSV")
    return int(told.removesuffix(".0"))


def _check_kind(path: Path, offset: int) -> None:
    """Refuse what holds other events: after the header come a byte with their type, and one with their size."""
    with path.open("rb") as file:
        file.seek(offset)
        kind = file.read(2)
    if len(kind) < 2:
        raise BadFile(f"{path.name} ends before its first event", fix="copy or export it again: it was cut short")
    if kind[0] not in CHANGES or kind[1] != 8:
        what = OTHERS.get(kind[0], f"type {kind[0]}, {kind[1]} bytes each")
        raise BadFile(
            f"{path.name} is a DAT file with events of another kind ({what})",
            fix="give the file with the changes of brightness, often named FILE_td.dat or FILE_cd.dat",
        )
