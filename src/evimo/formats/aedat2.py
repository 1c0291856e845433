"""AEDAT 2.0, as jAER records it: DVS128 and DAVIS cameras, the latter with an IMU."""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import EvimoWarning
from evimo.events.events import Events
from evimo.events.gyroscope import Gyroscope, gyroscope_of
from evimo.formats.aedat2_header import Header, header
from evimo.formats.aedat2_kernel import DAVIS, DVS128, RECORD_BYTES, decode_aedat2, gyroscope_values, others
from evimo.formats.clock_rules import NO_TIME
from evimo.formats.event_file import EventFile
from evimo.formats.sensors import assumed_sensor
from evimo.formats.survey import surveyed
from evimo.formats.word_file import WordFile

BLOCK_BYTES = RECORD_BYTES << 16  # of the gyroscope's pass
RECORD = np.dtype(("<u4", (2,)))  # big-endian, in truth: their bytes are turned where they are decoded


@dataclass(frozen=True, slots=True)
class Records:
    """The records of a file: where they begin, and whether they are a DAVIS's, else a DVS128's."""

    path: Path
    offset: int
    davis: bool

    def events(self, size: tuple[int, int], counts: NDArray[np.int64] | None = None) -> WordFile:
        """The polarity events, turned round by the (height, width); what else there is is added to `counts`."""

        def decode(records: NDArray[np.uint32], state: NDArray[np.int64], final: bool) -> Any:
            if self.davis and counts is not None:
                others(records, counts)
            return decode_aedat2(records, state, final, DAVIS if self.davis else DVS128, size)

        return WordFile(self.path, self.offset, RECORD, decode)

    def gyroscope(self) -> tuple[NDArray[np.int64], ...]:
        """Times (M,) in µs, axes (M,) and values (M,) of the gyroscope."""
        state, parts = np.full(1, NO_TIME), list[tuple[NDArray[np.int64], ...]]()
        with self.path.open("rb") as file:
            file.seek(self.offset)
            while raw := file.read(BLOCK_BYTES):
                parts.append(gyroscope_values(np.frombuffer(raw, RECORD, len(raw) // RECORD_BYTES), state))
        return tuple(np.concatenate(column) for column in zip(*parts, strict=True))


def open_aedat2(path: Path, sensor: tuple[int, int] | None = None) -> EventFile:
    """Open an AEDAT 2.0 recording of a DVS128 or a DAVIS: polarity events, and the gyroscope where there is one.

    jAER counts rows from the bottom and stores columns from the right; both are turned round here. Times are in 32
    bits in the file and go on where they wrap, after 72 minutes.

    Raises:
        BadFile: of another chip, or without events.
    """
    top = header(path)
    records, size, counts = Records(path, top.length, top.davis), sensor or top.size or (0, 0), np.zeros(2, np.int64)
    survey = surveyed(path, records.events(size, counts).blocks((top.length, np.full(1, NO_TIME))))
    size = size if any(size) else assumed_sensor(path, survey.extent)
    events = records.events(size)
    events.warn_if_cut("a record", stacklevel=3)

    def read(start_us: int) -> Iterator[Events]:
        return (packet for _, packet in events.blocks(survey.place(start_us)))

    return EventFile(
        path=path,
        format=f"AEDAT 2.0 ({top.chip or ('DAVIS' if top.davis else 'DVS128')})",
        sensor=size,
        start_us=survey.start_us,
        stop_us=survey.stop_us,
        read=read,
        read_gyroscope=lambda: _gyroscope(records, top),
        contents=_contents(*counts.tolist()),
    )


def _contents(samples: int, pixels: int) -> dict[str, str]:
    contents = {"IMU": f"{samples:,} samples"} if samples else {}
    return contents | ({"frames": "pixel by pixel, not read"} if pixels else {})


def _gyroscope(records: Records, top: Header) -> Gyroscope | None:
    """The gyroscope, scaled by the header's full scale, in its own axes; a sample of fewer than three axes is none."""
    if not records.davis:
        return None
    t_us, raw = _whole_samples(*records.gyroscope())
    if len(t_us) and top.gyroscope_scale is None:
        text = f"{records.path.name} does not tell its gyroscope's range: ±1000 degrees/s are taken, jAER's default"
        warnings.warn(text, EvimoWarning, stacklevel=4)
    rate = np.radians(raw * ((top.gyroscope_scale or 1000.0) / 32768))
    return gyroscope_of(t_us, rate, in_camera_axes=False, source=f"IMU of {top.chip or 'a DAVIS'}")


def _whole_samples(
    t_us: NDArray[np.int64], axis: NDArray[np.int64], value: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Times (N,) and raw values (N, 3) of the samples whose x, y and z follow each other."""
    x = np.flatnonzero((axis[:-2] == 0) & (axis[1:-1] == 1) & (axis[2:] == 2)) if len(axis) > 2 else np.zeros(0, int)
    return t_us[x], np.stack([value[x], value[x + 1], value[x + 2]], axis=1)
