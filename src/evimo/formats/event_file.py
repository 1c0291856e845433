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
from evimo.formats.damage import mended
from evimo.geometry.camera import Camera


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


@dataclass(slots=True)
class Faults:
    """Events that one pass over a recording had to move or leave out.

    out_of_order: came after a later event of the same packet, and were sorted into place.
    late:         older than a packet already given, dropped.
    outside:      not on the sensor, dropped.
    damaged:      lost between a damaged word and the next that can be trusted.
    """

    out_of_order: int = 0
    late: int = 0
    outside: int = 0
    damaged: int = 0

    @property
    def dropped(self) -> int:
        """Events left out."""
        return self.late + self.outside + self.damaged


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
    topic:       that of a bag which the events are from; empty where there are no topics.
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
            BadFile: more events go back in time than forward.
        """
        start = self.start_us if start_us is None else start_us
        stop = self.stop_us if stop_us is None else stop_us
        faults = self.faults = Faults()
        kept = 0
        for packet in tidied(self.read(start), self.sensor, faults):
            if packet.t[0] >= stop:
                break
            kept += len(packet)
            cut = packet.between(start, stop)
            if len(cut):
                yield cut
        self._report(faults, kept)

    def gyroscope(self) -> Gyroscope | None:
        """All samples of the gyroscope beside the sensor; None where the recording has none.

        They are read anew by each call, whole: a minute at 1 kHz is 2 MB.

        Raises:
            BadFile: they are damaged.
        """
        return self.read_gyroscope()

    def _report(self, faults: Faults, kept: int) -> None:
        if faults.late > kept:
            raise BadFile(
                f"{self.path.name}: {faults.late:,} of {faults.late + kept:,} events are older than events before them",
                fix="sort the recording by time, or split it where its clock starts again",
            )
        if parts := fault_parts(faults, self.sensor):
            warnings.warn(f"{self.path.name}: {'; '.join(parts)}", EvimoWarning, stacklevel=3)


def fault_parts(faults: Faults, sensor: tuple[int, int]) -> list[str]:
    """The faults in words, with counts; empty where there are none."""
    height, width = sensor
    parts = {
        f"{faults.out_of_order:,} events were out of order and sorted": faults.out_of_order,
        f"{faults.late:,} events older than the packet before them were dropped": faults.late,
        f"{faults.outside:,} events outside the {width}x{height} sensor were dropped": faults.outside,
        f"{faults.damaged:,} events beside damaged words are lost": faults.damaged,
    }
    return [words for words, count in parts.items() if count]


def tidied(packets: Iterator[Events], sensor: tuple[int, int], faults: Faults) -> Iterator[Events]:
    """Packets on the sensor and sorted, within and across; what was moved or dropped is counted in `faults`."""
    newest = np.iinfo(np.int64).min
    for packet in mended(packets, faults):
        packet = _in_order(_on_sensor(packet, sensor, faults), faults)
        late = int(np.searchsorted(packet.t, newest))
        faults.late += late
        packet = packet.part(late, len(packet))
        if len(packet):
            newest = packet.t[-1]
            yield packet


def _on_sensor(packet: Events, sensor: tuple[int, int], faults: Faults) -> Events:
    height, width = sensor
    if packet.x.max() < width and packet.y.max() < height:
        return packet
    inside = (packet.x < width) & (packet.y < height)
    faults.outside += len(packet) - int(inside.sum())
    return Events(packet.x[inside], packet.y[inside], packet.t[inside], packet.p[inside])


def _in_order(packet: Events, faults: Faults) -> Events:
    if (packet.t[1:] >= packet.t[:-1]).all():
        return packet
    faults.out_of_order += int((packet.t < np.maximum.accumulate(packet.t)).sum())
    order = np.argsort(packet.t, kind="stable")
    return Events(packet.x[order], packet.y[order], packet.t[order], packet.p[order])
