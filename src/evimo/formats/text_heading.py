"""The heading of a text file: what its lines before the first event say of columns, unit and sensor."""

import re
from dataclasses import dataclass, field

from evimo.formats.columns import named_columns, named_unit
from evimo.formats.time_units import TimeUnit

HEADING_LINES = 100
NUMBER = re.compile(r"[-+\u2212]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|nan|[-+]?inf|true|false|on|off", re.IGNORECASE)
SIDES = r"(\d{2,5})\s*[,;x×\s]\s*(\d{2,5})"
SIZES = (
    rf"[#%].*?geometry\W*{SIDES}",
    rf"[#%](?!.*(?:pixel|window|block|packet).?size).*?(?:resolution|size|sensor)\W*{SIDES}",
    rf"\W*{SIDES}\W*$",
)
SIDE = re.compile(r"(width|height)\W*(\d{2,5})\b", re.IGNORECASE)
OTHER_SIDES = re.compile(r"(pixel|window|block|packet)[\s_-]*(width|height)", re.IGNORECASE)


@dataclass(slots=True)
class Heading:
    """What comes before the first event: how long it is, and what it says of columns, unit and sensor.

    sides:   the sensor's, where they are told one by one.
    words:   what may name columns.
    unknown: a line that may name columns, but by no known names.
    """

    length: int = 0
    columns: str | None = None
    unit: TimeUnit | None = None
    sensor: tuple[int, int] | None = None
    sides: dict[str, int] = field(default_factory=dict[str, int])
    words: list[str] = field(default_factory=list[str])
    unknown: str = ""


def heading_of(raw: bytes) -> Heading:
    """Read the lines before the first event, in the beginning of a file."""
    heading = Heading(length=3 if raw.startswith(b"\xef\xbb\xbf") else 0)
    for line in raw[heading.length :].split(b"\n")[:HEADING_LINES]:
        text = line.decode(errors="replace").strip()
        words = named_words(text)
        numbers = [bool(NUMBER.fullmatch(word)) for word in words if word]
        if sum(numbers) > 2 and (text[0].isdecimal() or (numbers[0] and text[0] not in "#%")):
            break
        _heed(heading, text, words)
        heading.length += len(line) + 1
    return heading


def named_words(text: str) -> list[str]:
    """The words of a line that may name columns, comment or not."""
    plain = text.lstrip("#% ")
    return [word.strip(" \"'") for word in re.split(r"[,;\t]" if re.search(r"[,;\t]", plain) else r"\s+", plain)]


def _heed(heading: Heading, text: str, words: list[str]) -> None:
    """Take over what a line of the heading says: the sensor's size, names of columns, faery's `x@1280`."""
    if size := next((found for form in SIZES if (found := re.match(form, text, re.IGNORECASE))), None):
        heading.sensor = int(size[2]), int(size[1])
    sides = [] if OTHER_SIDES.search(text) else SIDE.findall(text)
    heading.sides |= {name.lower(): int(side) for name, side in sides}
    if len(heading.sides) == 2:
        heading.sensor = heading.sides["height"], heading.sides["width"]
    named = named_columns(words) or named_columns(text.lstrip("#% ").split())
    is_prose = text[:1] in ("#", "%") or any(NUMBER.fullmatch(word) for word in words)
    heading.unknown = "" if named or is_prose else text
    heading.words = words if named or not is_prose else heading.words
    if named:
        heading.columns = named
        heading.unit = named_unit(words, named) if len(words) == len(named) else None
        sizes = {name: int(size) for name, size in re.findall(r"\b([xy])@(\d+)", text)}
        if len(sizes) == 2:
            heading.sensor = sizes["y"], sizes["x"]
