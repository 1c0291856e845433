"""The header of an AEDAT 2.0 file: lines that begin with #, among them the chip and jAER's preferences."""

import re
from pathlib import Path
from typing import NamedTuple

from evimo.errors import BadFile

LONGEST_BYTES = 1 << 24
LINE = re.compile(rb"#[\t\x20-\x7e\x80-\xff]*\r?\n")
END = b"#End Of ASCII Header"
CHIP = re.compile(rb"^# *AEChip: *([\w.$]+)", re.MULTILINE)
RANGE = re.compile(rb'key="ImuGyroScale" value="\D*(\d+)"')
DAVIS_SIZES = {"128": (128, 128), "208": (192, 208), "240": (180, 240), "346": (260, 346), "640": (480, 640)}
FIRST_RECORDS = 8 * 4096


class Header(NamedTuple):
    """What the header tells, and the records where it is silent.

    length:          bytes until the first record.
    chip:            its name, empty where it is not told.
    davis:           whether records are laid out as of a DAVIS, else as of a DVS128.
    size:            (height, width), where the chip is known.
    gyroscope_scale: degrees/s of the largest value, where it is told.
    """

    length: int
    chip: str
    davis: bool
    size: tuple[int, int] | None
    gyroscope_scale: float | None


def header(path: Path) -> Header:
    """Read the header.

    Raises:
        BadFile: no record follows it, or the chip is neither a DVS128 nor a DAVIS.
    """
    with path.open("rb") as file:
        raw = file.read(LONGEST_BYTES)
    length = _length(raw)
    if length + 8 > len(raw):
        raise BadFile(f"{path.name} ends before its first record", fix="copy or record it again: it was cut short")
    text = raw[:length]
    named, scale = CHIP.search(text), RANGE.search(text)
    chip = named[1].decode().rpartition(".")[2] if named else ""
    size, davis = _layout(path, chip, raw[length : length + FIRST_RECORDS])
    return Header(length, chip, davis, size, float(scale[1]) if scale else None)


def _length(raw: bytes) -> int:
    """Bytes of the lines of text at the beginning; a record may begin with # too, but not with a whole such line."""
    at = 0
    while match := LINE.match(raw, at):
        at = match.end()
        if match[0].startswith(END):
            break
    return at


def _layout(path: Path, chip: str, records: bytes) -> tuple[tuple[int, int] | None, bool]:
    """(height, width) where known, and whether it is a DAVIS: by the chip, else by whether addresses have 16 bits."""
    if davis := re.search(r"(?i)davis.*?(\d{3})", chip):
        return DAVIS_SIZES.get(davis[1]), True
    if re.search(r"(?i)sbret(10|20|21)|davis", chip):
        return (DAVIS_SIZES["240"] if "ret" in chip.lower() else None), True
    if re.search(r"(?i)dvs128|tmpdiff128", chip):
        return (128, 128), False
    if chip:
        raise BadFile(
            f"{path.name} was recorded with {chip}; of AEDAT 2.0 only DVS128 and DAVIS are read",
            fix="convert it to text with jAER: one line `t x y p` per event",
        )
    davis = any(records[at] or records[at + 1] for at in range(0, len(records) - 7, 8))
    return (None if davis else (128, 128)), davis
