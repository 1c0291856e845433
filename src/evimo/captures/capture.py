"""Captures: folders in which `capture.yaml` says which files belong together, and how they fit (docs/captures.md)."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from evimo.captures.entries import Entry, load_entries, merged
from evimo.captures.mocap import is_bag, load_markers, load_tracks
from evimo.captures.scans import UNITS, Scan, load_scan
from evimo.captures.tracks import MarkerTracks, MocapTrack
from evimo.errors import BadFile, BadInput, NotFound
from evimo.formats import open_events
from evimo.formats.event_file import EventFile
from evimo.formats.sensors import sensor_size
from evimo.formats.time_units import TimeUnit
from evimo.geometry.calibration import load_camera
from evimo.geometry.camera import Camera, Lens

F8 = NDArray[np.float64]
Track = TypeVar("Track", MocapTrack, MarkerTracks)

CAPTURE = "capture.yaml"
READING = ("sensor", "time_unit", "columns", "topic")
TIME_UNITS: tuple[TimeUnit, ...] = ("s", "ms", "us", "ns")
LENSES: tuple[Lens, ...] = ("radtan", "fisheye")
LENS = ("fx", "fy", "cx", "cy", "height", "width")


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingSource:
    """The recording of a capture, and what its file does not tell, as for `open_events`."""

    path: Path
    sensor: tuple[int, int] | None = None
    time_unit: TimeUnit | None = None
    columns: str | None = None
    topic: str | None = None

    def opened(self) -> EventFile:
        """Open the events.

        Raises:
            NotFound, BadFile: as `open_events` says.
        """
        return open_events(
            self.path, sensor=self.sensor, time_unit=self.time_unit, columns=self.columns, topic=self.topic
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class CapturedCamera:
    """The event camera on its tracked body.

    body:          that it is fixed on.
    intrinsics:    a calibration file, or the camera itself; None where the recording holds it.
    body_from_cam: (4, 4); None until `evimo calibrate` has found it.
    """

    body: str
    intrinsics: Path | Camera | None = None
    body_from_cam: F8 | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CapturedObject:
    """A tracked object and its scan.

    id:             in the truth, from 1 to 65.
    scan:           a file or a folder, in its unit. markers: a text of their centres in the scan.
    body_from_scan: (4, 4), from the scan's axes in m; None until `evimo locate-markers` has found it.
    """

    name: str
    id: int
    body: str
    scan: Path
    unit: str = "m"
    markers: Path | None = None
    body_from_scan: F8 | None = None

    def load(self) -> Scan:
        """Load the scan.

        Raises:
            NotFound, BadFile: as `load_scan` says.
        """
        return load_scan(self.scan, unit=self.unit, markers=self.markers)


@dataclass(frozen=True, slots=True, kw_only=True)
class CapturedRoom:
    """The scan of everything that stands still, and where its axes lie in the world (4, 4)."""

    scan: Path
    unit: str
    world_from_scan: F8

    def load(self) -> Scan:
        """Load the scan.

        Raises:
            NotFound, BadFile: as `load_scan` says.
        """
        return load_scan(self.scan, unit=self.unit)


@dataclass(frozen=True, slots=True, kw_only=True)
class Capture:
    """One recording, what motion capture saw meanwhile, and scans; made by `open_capture`.

    mocap:     files of poses. markers: files of markers beside them.
    offset_us: what is added to the times of motion capture to get those of the events.
    """

    path: Path
    recording: RecordingSource
    camera: CapturedCamera
    mocap: tuple[Path, ...]
    markers: tuple[Path, ...]
    offset_us: int
    objects: tuple[CapturedObject, ...]
    room: CapturedRoom | None

    def lens(self, events: EventFile) -> Camera:
        """The camera's intrinsics, from capture.yaml or from the recording itself.

        Raises:
            NotFound: neither has them. BadFile, BadInput: they are no camera, or one of another size.
        """
        given = self.camera.intrinsics
        if given is None and events.camera is None:
            raise NotFound(
                f"{self.path} and {events.path.name} have no intrinsics", fix="`intrinsics: FILE` in `camera`"
            )
        if isinstance(given, Path):
            return load_camera(given, size=events.sensor, topic=events.topic or None)
        camera = events.camera.camera if given is None and events.camera else given
        if not isinstance(camera, Camera) or camera.size != events.sensor:
            size = camera.size if isinstance(camera, Camera) else None
            raise BadInput(
                f"{self.path}: a camera of {size}, but a sensor of {events.sensor}", fix="its own intrinsics"
            )
        return camera

    def tracks(self, *others: str) -> dict[str, MocapTrack]:
        """Where each body of the capture was, and others that are named, in the clock of the events.

        Raises:
            NotFound, BadFile: a file is missing or damaged, or no file has one of the bodies.
        """
        found: dict[str, MocapTrack] = {}
        for path in self.mocap:
            found |= _of_others(load_tracks(path, in_clock_of=self._clock(path)), found, path)
        wanted = [self.camera.body, *(each.body for each in self.objects), *others]
        for body in wanted:
            if body not in found:
                raise NotFound(f"{self.path}: no body {body!r} in its motion capture", fix=f"one of {', '.join(found)}")
        return {body: found[body].shifted(self.offset_us) for body in wanted}

    def marker_tracks(self) -> dict[str, MarkerTracks]:
        """Where the markers of each body were, by the body's name, in the clock of the events.

        Raises:
            NotFound, BadFile: a file is missing or damaged.
        """
        found: dict[str, MarkerTracks] = {}
        for path in self.markers or [path for path in self.mocap if is_bag(path)]:
            found |= _of_others(load_markers(path, in_clock_of=self._clock(path)), found, path)
        return {body: track.shifted(self.offset_us) for body, track in found.items()}

    def _clock(self, path: Path) -> str | None:
        """The topic of events whose clock times are brought to, where they are in the same bag."""
        return (self.recording.topic or "") if path == self.recording.path else None


def _of_others(more: dict[str, Track], found: Mapping[str, Track], path: Path) -> dict[str, Track]:
    """What a further file tells, which must be of other bodies: nothing says which of two files is right.

    Raises:
        BadFile: a body is in an earlier file, too.
    """
    if twice := sorted(found.keys() & more.keys()):
        raise BadFile(f"{path}: body {twice[0]!r} is in a file of this capture before it, too", fix="one file per body")
    return more


def open_capture(path: str | Path) -> Capture:
    """Open a capture: its folder, or the YAML file itself. Only the settings are read, and that the files are there.

    Raises:
        NotFound: there is no such folder, or a file that it names is missing.
        BadFile: an entry is wrong; the message names the file and the line.
    """
    path = Path(path)
    file = path / CAPTURE if path.is_dir() else path
    if not file.is_file():
        raise NotFound(f"there is no capture {file}", fix=f"a folder with {CAPTURE}; docs/captures.md has an example")
    whole = load_entries(file)
    for each in whole.named().get("calibration", Entry(file, 1, "", None)).entries():
        whole = merged(whole, load_entries(each.path()))
    keys = ("mocap", "objects", "room", "calibration")
    fields = whole.fields(("recording", "camera"), keys)
    recording = _recording(fields["recording"])
    mocap, markers, offset_us = _mocap(fields.get("mocap"), recording, whole)
    return Capture(
        path=file,
        recording=recording,
        camera=_camera(fields["camera"]),
        mocap=mocap,
        markers=markers,
        offset_us=offset_us,
        objects=_objects(fields.get("objects")),
        room=_room(fields["room"]) if "room" in fields else None,
    )


def _recording(entry: Entry) -> RecordingSource:
    if not isinstance(entry.value, dict):
        return RecordingSource(path=entry.path())
    fields = entry.fields(("file",), READING)
    sensor, unit = fields.get("sensor"), fields.get("time_unit")
    try:
        size = sensor_size(sensor.text()) if sensor else None
    except BadInput as error:
        raise (sensor or entry).wrong(error.problem, fix=error.fix) from error
    return RecordingSource(
        path=fields["file"].path(),
        sensor=size,
        time_unit=unit.one_of(TIME_UNITS) if unit else None,
        columns=fields["columns"].text() if "columns" in fields else None,
        topic=fields["topic"].text() if "topic" in fields else None,
    )


def _mocap(
    entry: Entry | None, recording: RecordingSource, whole: Entry
) -> tuple[tuple[Path, ...], tuple[Path, ...], int]:
    """Files of poses, files of markers, and the offset; without files, a recording that is a bag is its own."""
    fields = entry.fields((), ("files", "markers", "offset_us")) if entry else {}
    files = tuple(each.path() for each in fields["files"].entries()) if "files" in fields else ()
    markers = tuple(each.path() for each in fields["markers"].entries()) if "markers" in fields else ()
    if not files and not is_bag(recording.path):
        raise (entry or whole).wrong("names no files of motion capture", fix="`mocap: {files: [poses.csv]}`")
    offset = fields["offset_us"].number() if "offset_us" in fields else 0.0
    return files or (recording.path,), markers, round(offset)


def _camera(entry: Entry) -> CapturedCamera:
    fields = entry.fields(("body",), ("intrinsics", "body_from_cam"))
    given = fields.get("intrinsics")
    intrinsics = None if given is None else _lens(given) if isinstance(given.value, dict) else given.path()
    pose = fields["body_from_cam"].pose() if "body_from_cam" in fields else None
    return CapturedCamera(body=fields["body"].text(), intrinsics=intrinsics, body_from_cam=pose)


def _lens(entry: Entry) -> Camera:
    fields = entry.fields(LENS, ("distortion", "lens"))
    fx, fy, cx, cy = (fields[name].number() for name in LENS[:4])
    height, width = (fields[name].whole(1, 100_000) for name in LENS[4:])
    distortion = tuple(each.number() for each in fields["distortion"].entries()) if "distortion" in fields else ()
    lens: Lens = fields["lens"].one_of(LENSES) if "lens" in fields else "radtan"
    try:
        return Camera(fx, fy, cx, cy, height, width, distortion, lens)
    except BadInput as error:
        raise entry.wrong(error.problem, fix=error.fix) from error


def _objects(entry: Entry | None) -> tuple[CapturedObject, ...]:
    found: dict[int, CapturedObject] = {}
    for name, each in entry.named().items() if entry else ():
        fields = each.fields(("id", "body", "scan"), ("unit", "markers", "body_from_scan"))
        number = fields["id"].whole(1, 65)  # masks are stored as 1000 x id in 16 bits
        if number in found:
            raise fields["id"].wrong(f"is the id of {found[number].name} too", fix="another one")
        found[number] = CapturedObject(
            name=name,
            id=number,
            body=fields["body"].text(),
            scan=fields["scan"].path(),
            unit=fields["unit"].one_of(UNITS) if "unit" in fields else "m",
            markers=fields["markers"].path() if "markers" in fields else None,
            body_from_scan=fields["body_from_scan"].pose() if "body_from_scan" in fields else None,
        )
    return tuple(found[number] for number in sorted(found))


def _room(entry: Entry) -> CapturedRoom:
    fields = entry.fields(("scan",), ("unit", "world_from_scan"))
    pose = fields["world_from_scan"].pose() if "world_from_scan" in fields else np.eye(4)
    unit = fields["unit"].one_of(UNITS) if "unit" in fields else "m"
    return CapturedRoom(scan=fields["scan"].path(), unit=unit, world_from_scan=pose)
