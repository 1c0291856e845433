"""AEDAT 3, as cAER and early DV software record it: packets of events, frames and IMU samples."""

import re
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from evimo.errors import BadFile
from evimo.events.events import Events
from evimo.formats.choosing import chosen_of, listed
from evimo.formats.event_file import EventFile
from evimo.formats.event_record_kernel import ALL, KINDS, SOURCES, UNKNOWN, decode_aedat3
from evimo.formats.sensors import assumed_sensor
from evimo.formats.survey import Survey, surveyed
from evimo.formats.word_file import Place, WordFile

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


def open_aedat3(path: Path, sensor: tuple[int, int] | None = None, *, topic: str | None = None) -> EventFile:
    """Open an AEDAT 3.0 or 3.1 recording; its events count rows from the top, as ours do.

    Of several cameras that of `topic`, its number or name, is read, else the one with the most events.

    Raises:
        BadFile: packed in another way than plain, or without events. NotFound: no such topic.
    """
    length, text = _header(path)
    packing = re.search(r"^#Format: *(\S+)", text, re.MULTILINE)
    if packing and packing[1].upper() not in ("RAW", "PNGFRAMES"):
        raise BadFile(f"{path.name} is AEDAT 3 packed as {packing[1]}", fix="record or export it with the format RAW")
    survey, counts = _surveyed(path, length, _sources(text), topic)
    packets = _packets(path, length, _Counts(counts.source))

    def read(start_us: int) -> Iterator[Events]:
        return (events for _, events in packets.blocks(survey.place(start_us)))

    return EventFile(
        path=path,
        format="AEDAT 3",
        sensor=sensor or _size(_sources(text), counts.source) or assumed_sensor(path, survey.extent),
        start_us=survey.start_us,
        stop_us=survey.stop_us,
        read=read,
        contents={name: f"{counts.kinds[kind]:,}" for name, kind in CONTENTS.items() if counts.kinds[kind]}
        | counts.topics,
        topic=counts.topic,
    )


class _Counts:
    """What a pass counts: events by kind, and polarity events by their camera, behind which is the one to be read.

    source: that one, by number. topic, topics: its name and all of them, where there are several.
    """

    def __init__(self, source: int = ALL, topic: str = "", topics: Sequence[str] = ()) -> None:
        self.kinds = np.zeros(KINDS, np.int64)
        self.sources = np.append(np.zeros(SOURCES, np.int64), source)
        self.source, self.topic = source, topic
        self.topics = {"topics": listed(topics)} if topics else {}

    def cameras(self) -> list[int]:
        """The numbers of those that have events, the most first."""
        counts = self.sources[:SOURCES]
        return np.argsort(-counts, kind="stable")[: np.count_nonzero(counts)].tolist()


def _packets(path: Path, offset: int, counts: _Counts) -> WordFile:
    decode: Any = partial(decode_aedat3, kinds=counts.kinds, sources=counts.sources)
    return WordFile(path, offset, np.dtype("u1"), decode)


def _surveyed(path: Path, length: int, names: dict[int, str], topic: str | None) -> tuple[Survey[Place], _Counts]:
    """One pass over all packets; another one over those of one camera, where there are several.

    Raises:
        BadFile, NotFound: as `open_aedat3`.
    """
    start, counts, problem, survey = (length, np.array([0, UNKNOWN])), _Counts(), None, Survey[Place]()
    try:
        survey = surveyed(path, _packets(path, length, counts).blocks(start))
    except BadFile as error:  # two clocks side by side are in no order
        problem = error
    if len(found := counts.cameras()) > (1 if topic is None else 0):
        topics = [f"{number}/{names.get(number, '')}".strip("/") for number in found]
        place = chosen_of(path, topics, topic)
        counts = _Counts(found[place], topics[place], topics)
        return surveyed(path, _packets(path, length, counts).blocks(start)), counts
    if problem:
        raise problem
    return survey, counts


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


def _sources(text: str) -> dict[int, str]:
    """The cameras that the header names, by their numbers."""
    return {int(number): name for number, name in re.findall(r"^#Source +(\d{1,5}): *(\S+)", text, re.MULTILINE)}


def _size(names: dict[int, str], source: int) -> tuple[int, int] | None:
    """(height, width) of a camera by its name, or of the first that is known."""
    told = [names[source]] if source in names else names.values()
    found = (size for name in told for known, size in SIZES.items() if name.upper().startswith(known))
    return next(found, None)
