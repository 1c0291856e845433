"""AEDAT 4 through dv-processing."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from evimo.errors import BadFile
from evimo.events.events import Events
from evimo.events.io.event_file import EventFile
from evimo.events.io.survey import no_events_in

PACKET_EVENTS = 100_000  # aimed at by the length of the windows that are asked for
LONGEST_WINDOW_US = 10_000_000


def open_aedat4(path: Path, sensor: tuple[int, int] | None = None) -> EventFile:
    """Open an AEDAT 4 recording of one camera.

    Raises:
        BadFile: cut short, damaged, or without events.
    """
    recording = _recording(path)
    start_us, stop_us = _span(path, recording)
    width, height = recording.getEventResolution()

    def read(start: int) -> Iterator[Events]:
        return _packets(_recording(path), max(start, start_us), stop_us)

    return EventFile(
        path=path,
        format="AEDAT 4",
        sensor=sensor or (height, width),
        start_us=start_us,
        stop_us=stop_us,
        read=read,
        contents=_contents(recording),
    )


def _recording(path: Path) -> Any:
    import dv_processing

    try:
        recording = dv_processing.io.MonoCameraRecording(str(path))
    except RuntimeError as error:
        cause = str(error).split("Stacktrace")[0].strip().splitlines()[-1]
        raise BadFile(f"{path.name} is no whole AEDAT 4 file: {cause}", fix="copy or record it again") from error
    if not recording.isEventStreamAvailable():
        raise no_events_in(path)
    return recording


def _span(path: Path, recording: Any) -> tuple[int, int]:
    """Times of the first event and of the last + 1; the file's own range covers frames and IMU too."""
    first = recording.getNextEventBatch()
    if first is None:
        raise no_events_in(path)
    start = int(first.getLowestTime())
    stop = int(recording.getTimeRange()[1]) + 1
    window = 1_000_000
    while (last := recording.getEventsTimeRange(max(stop - window, start), stop)) is None or last.isEmpty():
        window *= 2
    return start, int(last.getHighestTime()) + 1


def _packets(recording: Any, start: int, stop: int) -> Iterator[Events]:
    """Windows of time that hold about PACKET_EVENTS events each."""
    window = 10_000
    while start < stop:
        store = recording.getEventsTimeRange(start, start + window)
        start += window
        count = 0 if store is None else store.size()
        if count:
            yield _as_events(store.numpy())
        if count < PACKET_EVENTS // 2:
            window = min(window * 2, LONGEST_WINDOW_US)
        elif count > PACKET_EVENTS * 2:
            window = max(window // 2, 1000)


def _as_events(stored: np.ndarray[Any, Any]) -> Events:
    return Events(
        stored["x"].astype(np.uint16),
        stored["y"].astype(np.uint16),
        stored["timestamp"].astype(np.int64),
        (2 * stored["polarity"] - 1).astype(np.int8),
    )


def _contents(recording: Any) -> dict[str, str]:
    contents: dict[str, str] = {"camera": recording.getCameraName()}
    if recording.isFrameStreamAvailable() and recording.getNextFrame() is not None:
        width, height = recording.getFrameResolution()
        contents["frames"] = f"{width}x{height}"
    if recording.isImuStreamAvailable() and recording.getNextImuBatch() is not None:
        contents["IMU"] = "yes"
    if recording.isTriggerStreamAvailable() and recording.getNextTriggerBatch() is not None:
        contents["triggers"] = "yes"
    return contents
