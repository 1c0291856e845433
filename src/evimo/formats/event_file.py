"""What every reader gives: sensor, span and packets of one recording, in constant memory."""

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, BadInput, EvimoWarning
from evimo.events.events import Events
from evimo.events.gyroscope import Gyroscope
from evimo.formats.clock import WINDOW_US, Clock, Faults, sorted_packets
from evimo.formats.damage import mended
from evimo.formats.sensors import size_in_words
from evimo.geometry.camera import Camera

MOST_PER_US = 1000  # events: no sensor gives more
FEW = 64  # events that are never too many to leave out
LATE_SHARE = 20  # one event in so many may be late; more, and the order of the file is no order in time


class FoundCamera(NamedTuple):
    """A camera whose intrinsics lie inside a recording, and the words that say where."""

    camera: Camera
    source: str


def found_camera(numbers: Callable[[], Camera | None], source: str) -> FoundCamera | None:
    """Return the camera that a recording holds; None, with a warning, where its numbers are those of no camera."""
    try:
        camera = numbers()
    except (BadInput, TypeError, ValueError) as error:
        why = error.problem if isinstance(error, BadInput) else error
        text = f"the intrinsics in {source} are ignored: {why}"
        warnings.warn(text, EvimoWarning, stacklevel=2)
        return None
    return None if camera is None else FoundCamera(camera, source)


def camera_of_matrix(matrix: NDArray[np.floating], size: tuple[int, int]) -> Camera | None:
    """Return the pinhole of a camera matrix (3, 3); None where the matrix holds zeros, as files without one do."""
    if not np.any(matrix):
        return None
    if matrix.shape != (3, 3):
        raise ValueError(f"a camera matrix of {matrix.shape}")
    fx, fy, cx, cy = (float(matrix[at]) for at in ((0, 0), (1, 1), (0, 2), (1, 2)))
    return Camera(fx, fy, cx, cy, *size)


def no_gyroscope() -> Gyroscope | None:
    """What a recording without a gyroscope says of it."""
    return None


@dataclass(slots=True, kw_only=True, eq=False)
class EventFile:
    """One recording of one sensor, read lazily.

    sensor:      (height, width) in px.
    start_us:    time of the first event, in the file's own clock.
    stop_us:     time of the last event + 1.
    read:        the format's reader: packets from a place at or before the given time to the end, as stored.
    camera:      the one whose intrinsics lie inside the file.
    read_gyroscope: the format's reader of gyroscopes.
    contents:    what else is inside, name to description.
    topic:       that of the events, of a bag or of a file of several cameras; empty where there are no topics.
    faults:      what the newest pass had to move or leave out; complete when the pass is.
    """

    path: Path
    format: str
    sensor: tuple[int, int]
    start_us: int
    stop_us: int
    read: Callable[[int], Iterator[Events]]
    camera: FoundCamera | None = None
    read_gyroscope: Callable[[], Gyroscope | None] = no_gyroscope
    contents: dict[str, str] = field(default_factory=dict[str, str])
    topic: str = ""
    faults: Faults = field(default_factory=Faults, init=False)

    def __iter__(self) -> Iterator[Events]:
        return self.packets()

    def packets(self, start_us: int | None = None, stop_us: int | None = None) -> Iterator[Events]:
        """Time-sorted packets of any size, never empty, with start_us <= t < stop_us.

        Warns once at the end of the pass if events had to be sorted or dropped.

        Raises:
            BadFile: the order of the events cannot be restored, or most lie outside the sensor.
        """
        start = self.start_us if start_us is None else start_us
        stop = self.stop_us if stop_us is None else stop_us
        faults = self.faults = Faults()
        clock = Clock(faults, from_start=start <= self.start_us)
        kept = 0
        for packet in sorted_packets(on_sensor(self.read(start), self.sensor, faults), clock):
            if packet.t[0] >= stop:
                break
            kept += len(packet)
            cut = packet.between(start, stop)
            if len(cut):
                yield cut
        whole = (start, stop) == (self.start_us, self.stop_us)
        self._report(faults, kept, whole=whole)
        if whole:
            refuse_strange_times(self.path, faults, kept, stop - start)

    def gyroscope(self) -> Gyroscope | None:
        """All samples of the gyroscope beside the sensor; None where the recording has none.

        They are read anew by each call, whole: a minute at 1 kHz is 2 MB.

        Raises:
            BadFile: they are damaged.
        """
        return self.read_gyroscope()

    def _report(self, faults: Faults, kept: int, *, whole: bool) -> None:
        refuse_disorder(self.path, faults, kept)
        if faults.outside > (max(kept, FEW) if kept else 0) and (whole or not kept):
            beside = f"{faults.outside:,} of {faults.outside + kept:,} events lie outside"
            beside = beside if kept else f"none of {faults.outside:,} events lies on"
            raise BadFile(
                f"{self.path.name}: {beside} a sensor of {size_in_words(self.sensor)}",
                fix="give its size with --sensor WxH, and the order of a table's columns with --columns, as in txyp",
            )
        if parts := faults.parts(self.sensor):
            warnings.warn(f"{self.path.name}: {'; '.join(parts)}", EvimoWarning, stacklevel=3)


def refuse_disorder(path: Path, faults: Faults, kept: int) -> None:
    """Refuse a recording whose order in time is lost.

    Raises:
        BadFile: more than one event in twenty is late, or most come after a reset of the clock.
    """
    whole = faults.late + faults.after_reset + kept
    if faults.late * LATE_SHARE <= whole and faults.after_reset <= kept:
        return
    lost, old = faults.late + faults.after_reset, f"more than {WINDOW_US // 1000} ms older than events before them"
    raise BadFile(
        f"{path.name}: {lost:,} of {whole + faults.outlying:,} events are {old}",
        fix="sort the recording by time, or split it where its clock starts again",
    )


def refuse_strange_times(path: Path, faults: Faults, kept: int, span_us: int) -> None:
    """Refuse a recording, all of which was read, whose times stand still or mostly lie apart from each other.

    Seconds since 1970 stand still in float32. Of a part of a recording neither tells: a strange block may fill it.

    Raises:
        BadFile: so many events in so short a span are those of no sensor, or a third are far from those around them.
    """
    whole = faults.late + faults.after_reset + kept
    if 2 * faults.outlying > max(whole, 2 * FEW):
        raise BadFile(
            f"{path.name}: the times of {faults.outlying:,} of {whole + faults.outlying:,} events are far from those "
            "around them",
            fix="export it again: its events may be of several cameras, one after the other",
        )
    if kept > MOST_PER_US * span_us:
        raise BadFile(
            f"{path.name}: its {kept:,} events lie within {span_us} µs: their times stand still",
            fix="export it with all digits of its times, as whole µs or float64 seconds; or check --time-unit",
        )


def on_sensor(packets: Iterator[Events], sensor: tuple[int, int], faults: Faults) -> Iterator[Events]:
    """Packets without the events outside the sensor, which are counted; empty ones are left out."""
    height, width = sensor
    for packet in mended(packets, faults):
        if packet.x.max() < width and packet.y.max() < height:
            yield packet
            continue
        inside = (packet.x < width) & (packet.y < height)
        faults.outside += len(packet) - int(inside.sum())
        yield Events(packet.x[inside], packet.y[inside], packet.t[inside], packet.p[inside])
