"""What is to be shown of a recording or of a run, opened lazily."""

import json
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py

from evimo.errors import BadFile, BadInput, EvimoError, EvimoWarning
from evimo.formats.event_file import EventFile
from evimo.geometry.camera import Camera
from evimo.predictions.runs import ESTIMATES, open_estimates, opened_h5
from evimo.predictions.sources import Maps
from evimo.recordings.recording import Recording
from evimo.viewing.window.sources import Markers, Shape, StoredTruth, TruthSource

SUMMARY = "summary.json"
NO_MAPS = "run it again with --dense: evimo run RECORDING --dense --out FOLDER"


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """What there is to show; None is what nobody knows.

    name:      in the window.
    sensor:    (height, width), px.
    events:    of the recording.
    truth:     what really happened.
    estimates: of a run, in the order of their times.
    shapes, markers: of a capture.
    """

    name: str
    sensor: tuple[int, int]
    camera: Camera | None = None
    events: EventFile | None = None
    truth: TruthSource | None = None
    estimates: Maps | None = None
    shapes: tuple[Shape, ...] = ()
    markers: tuple[Markers, ...] = ()


@dataclass(frozen=True, slots=True)
class Result:
    """A run that was saved: its maps, and what `summary.json` tells."""

    folder: Path
    sensor: tuple[int, int]
    summary: dict[str, Any]

    @property
    def camera(self) -> Camera | None:
        """The camera that the run used."""
        stored = self.summary.get("camera")
        if not isinstance(stored, dict):
            return None
        try:
            fields: dict[str, Any] = {name: stored[name] for name in Camera.__dataclass_fields__}
            fields["distortion"] = tuple(fields["distortion"])
            return Camera(**fields)
        except (KeyError, TypeError, EvimoError) as error:
            raise BadFile(f"{self.folder / SUMMARY} tells of no camera", fix="run it again") from error

    @property
    def recording(self) -> Path | None:
        """Where the recording was when the run was made; None where that is not told, or it is there no more."""
        told: Any = self.summary.get("recording")
        path = told.get("path") if isinstance(told, dict) else None
        return Path(path) if isinstance(path, str) and Path(path).exists() else None

    def estimates(self) -> Maps:
        """The maps, slice by slice."""
        maps = open_estimates(self.folder / ESTIMATES, self.sensor).maps
        assert maps is not None  # of this file
        return maps


def is_result(path: Path) -> bool:
    """Whether `evimo run` has written this folder, or this is the `estimates.h5` in it."""
    if path.is_dir():
        return (path / ESTIMATES).is_file() or (path / SUMMARY).is_file()
    return path.name == ESTIMATES and path.is_file()


def open_result(path: Path) -> Result:
    """Open the folder of a run, or the `estimates.h5` in it.

    Raises:
        BadFile: it holds no maps, or they or its summary are damaged.
    """
    folder = path if path.is_dir() else path.parent
    if not (folder / ESTIMATES).is_file():
        raise BadFile(f"{folder} is of a run that left no {ESTIMATES}", fix=NO_MAPS)
    summary = folder / SUMMARY
    try:
        told: Any = json.loads(summary.read_text(encoding="utf-8")) if summary.is_file() else {}
        content: dict[str, Any] = dict(told)
    except (ValueError, TypeError) as error:
        raise BadFile(f"{summary} is not the JSON that a run leaves", fix="run it again") from error
    with opened_h5(folder / ESTIMATES) as file:
        valid: Any = file.get("valid")
        if not isinstance(valid, h5py.Dataset) or len(valid.shape) != 2:
            raise BadFile(f"{folder / ESTIMATES} lacks `valid`, or holds it in another type", fix=NO_MAPS)
        sensor = (int(valid.shape[0]), int(valid.shape[1]))
    return Result(folder, sensor, content)


def of_result(result: Result, events: EventFile | None, recording: Recording | None) -> Subject:
    """A run beside its recording, as far as that is known.

    Raises:
        BadInput: the recording has another sensor.
    """
    if events is not None and events.sensor != result.sensor:
        sizes = [f"{width}x{height}" for height, width in (events.sensor, result.sensor)]
        raise BadInput(
            f"{events.path} has {sizes[0]} px, the run in {result.folder} {sizes[1]}", fix="the recording of that run"
        )
    if events is None:
        text = (
            f"the recording of {result.folder} is not where it was: its events and truth are left out; --recording PATH"
        )
        warnings.warn(text, EvimoWarning, stacklevel=2)
    return Subject(
        name=result.folder.name or "run",
        sensor=result.sensor,
        camera=recording.camera if recording is not None else result.camera,
        events=events,
        truth=None if recording is None else StoredTruth(recording),
        estimates=result.estimates(),
    )
