"""AEDAT 2.0, as jAER records it: DVS128 and DAVIS cameras, the latter with an IMU."""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, EvimoWarning
from evimo.events.events import Events
from evimo.events.gyroscope import Gyroscope, gyroscope_of
from evimo.formats.aedat2_header import Header, header
from evimo.formats.aedat2_words import RECORD_BYTES, Words, davis_events, dvs128_events, gyroscope_words, words
from evimo.formats.event_file import EventFile
from evimo.formats.sensors import assumed_sensor
from evimo.formats.survey import surveyed

BLOCK_BYTES = RECORD_BYTES << 17

Place = tuple[int, int]  # byte offset, and the time in µs reached there


@dataclass(slots=True)
class Tally:
    """What one pass held besides events: samples of the gyroscope, of frames."""

    gyroscope: int = 0
    frames: int = 0


@dataclass(frozen=True, slots=True)
class Recording:
    """A file, its header, and the (height, width) by which pixels are turned round; (0, 0) leaves them as stored."""

    path: Path
    header: Header
    size: tuple[int, int] = (0, 0)

    def blocks(self, place: Place) -> Iterator[tuple[Place, Words]]:
        """Records from a place on, in blocks, with their times continued over wraps."""
        offset, reached = place
        with self.path.open("rb") as file:
            file.seek(offset)
            while raw := file.read(BLOCK_BYTES):
                block = words(raw, reached)
                yield (offset, reached), block
                offset, reached = offset + len(raw), int(block.t[-1])

    def events(self, place: Place, tally: Tally) -> Iterator[tuple[Place, Events]]:
        """The events of each block; what else it holds is counted."""
        for at, block in self.blocks(place):
            if self.header.davis:
                tally.gyroscope += block.gyroscope_samples()
                tally.frames += block.frame_samples()
                yield at, davis_events(block, self.size)
            else:
                yield at, dvs128_events(block, self.size)

    def start(self) -> Place:
        """Where records begin; the first time is taken as it is, without sign."""
        with self.path.open("rb") as file:
            file.seek(self.header.length)
            return self.header.length, int.from_bytes(file.read(RECORD_BYTES)[4:], "big")


def open_aedat2(path: Path, sensor: tuple[int, int] | None = None) -> EventFile:
    """Open an AEDAT 2.0 recording of a DVS128 or a DAVIS: polarity events, and the gyroscope where there is one.

    jAER counts rows from the bottom and stores columns from the right; both are turned round here. Times are in 32
    bits in the file and go on where they wrap, after 72 minutes.

    Raises:
        BadFile: of another chip, cut short inside a record, or without events.
    """
    top = header(path)
    if (path.stat().st_size - top.length) % RECORD_BYTES:
        raise BadFile(f"{path.name} ends inside a record: it was cut short", fix="copy or record it again")
    tally = Tally()
    recording = Recording(path, top, sensor or top.size or (0, 0))
    survey = surveyed(path, recording.events(recording.start(), tally))
    if not any(recording.size):
        recording = replace(recording, size=assumed_sensor(path, survey.extent))

    def read(start_us: int) -> Iterator[Events]:
        return (events for _, events in recording.events(survey.place(start_us), Tally()))

    return EventFile(
        path=path,
        format=f"AEDAT 2.0 ({top.chip or ('DAVIS' if top.davis else 'DVS128')})",
        sensor=recording.size,
        start_us=survey.start_us,
        stop_us=survey.stop_us,
        read=read,
        read_gyroscope=lambda: _gyroscope(recording),
        contents=_contents(tally),
    )


def _contents(tally: Tally) -> dict[str, str]:
    counts = {"IMU": f"{tally.gyroscope:,} samples", "frames": "pixel by pixel, not read"}
    return {name: words for name, words in counts.items() if (tally.gyroscope if name == "IMU" else tally.frames)}


def _gyroscope(recording: Recording) -> Gyroscope | None:
    """The gyroscope, scaled by the header's full scale, in its own axes; a sample of fewer than three axes is none."""
    if not recording.header.davis:
        return None
    parts = [gyroscope_words(block) for _, block in recording.blocks(recording.start())]
    t_us, address = (np.concatenate([part[at] for part in parts]) for at in (0, 1))
    t_us, raw = _whole_samples(t_us, address)
    if len(t_us) and recording.header.gyroscope_scale is None:
        text = f"{recording.path.name} does not tell its gyroscope's range: ±1000 degrees/s are taken, jAER's default"
        warnings.warn(text, EvimoWarning, stacklevel=4)
    rate = np.radians(raw * ((recording.header.gyroscope_scale or 1000.0) / 32768))
    return gyroscope_of(t_us, rate, in_camera_axes=False, source=f"IMU of {recording.header.chip or 'a DAVIS'}")


def _whole_samples(t_us: NDArray[np.int64], address: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Times (N,) and raw values (N, 3) of the samples whose x, y and z follow each other."""
    axis = (address >> 28) & 7
    value = ((address >> 12) & 0xFFFF).astype(np.uint16).view(np.int16).astype(np.int64)
    x = np.flatnonzero((axis[:-2] == 4) & (axis[1:-1] == 5) & (axis[2:] == 6)) if len(axis) > 2 else np.zeros(0, int)
    return t_us[x], np.stack([value[x], value[x + 1], value[x + 2]], axis=1)
