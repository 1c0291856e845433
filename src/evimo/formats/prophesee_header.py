"""The header of Prophesee's files, RAW and DAT: lines of text that begin with %, old and new; or none at all."""

import re
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile

Encoding = Literal["EVT2", "EVT21", "EVT3"]

LONGEST_BYTES = 1 << 16
SAMPLE_BYTES = 1 << 18
LINE = re.compile(rb"%[\t\x20-\x7e\x80-\xff]*\r?\n")
END = re.compile(rb"% *end *\r?\n")
RAW_MARK = re.compile(
    rb"^% *((?i:evt +\d|format +evt)|plugin_name|integrator_name|camera_integrator_name)", re.MULTILINE
)
DAT_MARK = re.compile(rb"^% *Data file containing", re.MULTILINE)
ENCODINGS: dict[str, Encoding] = {
    **dict.fromkeys(("2.0", "2", "20"), "EVT2"),
    **dict.fromkeys(("2.1", "21"), "EVT21"),
    **dict.fromkeys(("3.0", "3", "30"), "EVT3"),
}
# (height, width) by what old headers tell of the camera, the first that is found in them.
SENSORS = {"genx320": (320, 320), "gen4": (720, 1280), "imx636": (720, 1280), "imx646": (720, 1280), "gen3": (480, 640)}
KINDS = {"EVT3": (0, 2, 3, 4, 5, 6, 7, 8, 10, 14, 15), "EVT2": (0, 1, 8, 10, 14, 15)}  # of words, by encoding
TIME_LOW, TIME_HIGH = 6, 8
LONGEST_STEP = {12: 64, 28: 1 << 14}  # of a steady clock, by its bits


class Header(NamedTuple):
    """Bytes until the first word, and what the lines say: the first word of each to the rest of it."""

    length: int
    fields: dict[str, str]

    def size(self) -> tuple[int, int] | None:
        """(height, width) where the lines tell it, or the camera's name does."""
        places = self.fields.get("geometry", ""), f"{self.fields.get('Width')}x{self.fields.get('Height')}"
        for place in places:
            if match := re.fullmatch(r"(\d+) *[xX] *(\d+)", place):
                return _sensible(int(match[2]), int(match[1]))
        told = dict(re.findall(r"(\w+)=(\d+)", self.fields.get("format", "")))
        if {"width", "height"} <= told.keys():
            return _sensible(int(told["height"]), int(told["width"]))
        names = " ".join(self.fields.get(key, "") for key in ("plugin_name", "sensor_name")).lower()
        return next((size for name, size in SENSORS.items() if name in names), None)


def _sensible(height: int, width: int) -> tuple[int, int] | None:
    return (height, width) if 0 < height <= 1 << 16 and 0 < width <= 1 << 16 else None


def header(path: Path) -> Header:
    """Read the lines at the beginning; there may be none."""
    with path.open("rb") as file:
        raw = file.read(LONGEST_BYTES)
    return header_of(raw)


def header_of(raw: bytes) -> Header:
    """The lines at the beginning of these bytes; a word may look like the beginning of a line, not like a whole one."""
    at, fields = 0, dict[str, str]()
    while match := LINE.match(raw, at):
        at = match.end()
        if END.fullmatch(match[0]):
            break
        key, _, value = match[0][1:].decode("latin-1").strip().partition(" ")
        fields.setdefault(key, value.strip())
    return Header(at, fields)


def encoding(path: Path, head: Header) -> Encoding:
    """The encoding that the header names, else the one whose words the content is made of.

    Raises:
        BadFile: it names another, or the content is of none.
    """
    named = head.fields.get("format", "").partition(";")[0] or head.fields.get("evt", "")
    if (number := re.sub(r"(?i)^evt[ _]?", "", named)) in ENCODINGS:
        return ENCODINGS[number]
    if named:
        raise BadFile(
            f"{path.name} is a Prophesee recording in {named}, which is not supported",
            fix="export it with Metavision as EVT 2, 2.1 or 3, or as CSV",
        )
    found = words_encoding(sample(path, head.length))
    if found is None:
        raise BadFile(
            f"{path.name} is a Prophesee recording whose header does not tell its encoding, and its content neither",
            fix="add the line `% evt 2.0`, `% evt 2.1` or `% evt 3.0` to its header, or export it again",
        )
    return found


def sample(path: Path, offset: int) -> bytes:
    """The first words after the header."""
    with path.open("rb") as file:
        file.seek(offset)
        return file.read(SAMPLE_BYTES)


def words_encoding(raw: bytes) -> Encoding | None:
    """The encoding whose words these are: all kinds are known to it, and its clock goes on steadily.

    Words of EVT 2.1 are pairs of those of EVT 2.0, of which one tells the kind: only in that half are clocks.
    """
    shorts = np.frombuffer(raw, "<u2", len(raw) // 2).astype(np.int64)
    if (shorts >> 12 == TIME_LOW).any() and _sense(shorts >> 12, shorts & 0xFFF, "EVT3") > 0.95:
        return "EVT3"
    words = np.frombuffer(raw, "<u4", len(raw) // 8 * 2).astype(np.int64)
    kind, clock = words >> 28, words & 0xFFFFFFF
    by_half = np.bincount(np.flatnonzero(kind == TIME_HIGH) % 2, minlength=2)
    if 8 * by_half.min() > by_half.sum() and _sense(kind, clock, "EVT2") > 0.95:
        return "EVT2"
    return "EVT21" if max(_sense(kind[half::2], clock[half::2], "EVT2") for half in (0, 1)) > 0.95 else None


def head_is_second(raw: bytes) -> bool:
    """Whether the half of EVT 2.1 words that tells the kind is the second of the two, as in whole 64-bit words."""
    words = np.frombuffer(raw, "<u4", len(raw) // 8 * 2).astype(np.int64)
    kind, clock = words >> 28, words & 0xFFFFFFF
    for count in (1 << 12, len(words)):  # the first words alone, where they tell: bytes may be missing further on
        first, second = (_sense(kind[half:count:2], clock[half:count:2], "EVT2") for half in (0, 1))
        if max(first, second) > 0.95:
            break
    return second >= first


def _sense(kind: NDArray[np.int64], clock: NDArray[np.int64], name: Literal["EVT2", "EVT3"]) -> float:
    """Which share of these kinds is known, and of these clocks steady, the lower of both; 0 with hardly any clock."""
    bits = 12 if name == "EVT3" else 28
    steps = np.diff(clock[kind == TIME_HIGH]) & ((1 << bits) - 1)
    if len(steps) < 2:
        return 0.0
    return float(min(np.isin(kind, KINDS[name]).mean(), (steps <= LONGEST_STEP[bits]).mean()))
