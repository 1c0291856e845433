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
RAW_MARK = re.compile(rb"^% *(evt +\d|format +EVT|plugin_name|integrator_name|camera_integrator_name)", re.MULTILINE)
DAT_MARK = re.compile(rb"^% *Data file containing", re.MULTILINE)
ENCODINGS: dict[str, Encoding] = {
    "2.0": "EVT2",
    "2": "EVT2",
    "EVT2": "EVT2",
    "2.1": "EVT21",
    "EVT21": "EVT21",
    "EVT2.1": "EVT21",
    "3.0": "EVT3",
    "3": "EVT3",
    "EVT3": "EVT3",
}
# (height, width) by what old headers tell of the camera, the first that is found in them.
SENSORS = {"genx320": (320, 320), "gen4": (720, 1280), "imx636": (720, 1280), "imx646": (720, 1280), "gen3": (480, 640)}
# Kinds of word that each encoding has, the type of its words, and the bits of its TIME HIGH.
KINDS: dict[Encoding, set[int]] = {
    "EVT3": {0, 2, 3, 4, 5, 6, 7, 8, 10, 14, 15},
    "EVT21": {0, 1, 8, 10, 14, 15},
    "EVT2": {0, 1, 8, 10, 14, 15},
}


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
    if named in ENCODINGS:
        return ENCODINGS[named]
    if named:
        raise BadFile(
            f"{path.name} is a Prophesee recording in {named}, which is not supported",
            fix="export it with Metavision as EVT 2, 2.1 or 3, or as CSV",
        )
    found = encoding_of(sample(path, head.length))
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


def encoding_of(raw: bytes) -> Encoding | None:
    """The encoding whose words these are: all kinds are known to it, and its clock goes on steadily."""
    for name, kinds in KINDS.items():
        for kind, clock in _heads(raw, name):
            highs, known = clock[kind == 8], np.isin(kind, list(kinds)).mean() if len(kind) else 0.0
            lows_too = name != "EVT3" or bool((kind == 6).any())
            if len(highs) > 2 and known > 0.99 and lows_too and _steady(highs, 12 if name == "EVT3" else 28):
                return name
    return None


def _heads(raw: bytes, name: Encoding) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Kind and upper bits of the clock of each word; of EVT 2.1 by both orders of its halves."""
    if name == "EVT3":
        words = np.frombuffer(raw, "<u2", len(raw) // 2).astype(np.int64)
        return [(words >> 12, words & 0xFFF)]
    words = np.frombuffer(raw, "<u4", len(raw) // 8 * 2).astype(np.int64)
    halves = [words[1::2], words[0::2]] if name == "EVT21" else [words]
    return [(half >> 28, half & 0xFFFFFFF) for half in halves]


def _steady(highs: NDArray[np.int64], bits: int) -> bool:
    steps = np.diff(highs) & ((1 << bits) - 1)
    return bool((steps <= 1 << (bits // 2)).mean() > 0.95)


def head_is_second(raw: bytes) -> bool:
    """Whether the half of EVT 2.1 words that tells the kind is the second of the two, as in whole 64-bit words."""
    scores = [_sense(kind, clock) for kind, clock in _heads(raw, "EVT21")]
    return scores[0] >= scores[1]


def _sense(kind: NDArray[np.int64], clock: NDArray[np.int64]) -> float:
    """How far these kinds and clocks make sense."""
    if not len(kind):
        return 0.0
    steps = np.diff(clock[kind == 8])
    steady = float(((steps >= 0) & (steps < 1 << 14)).mean()) if len(steps) else 0.0
    return float(np.isin(kind, list(KINDS["EVT21"])).mean()) + steady
