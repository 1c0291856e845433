"""The window of `evimo view`: what is written, and how it is shown."""

import subprocess
import tempfile
import webbrowser
from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from evimo.cli.progress import progress
from evimo.cli.reading import Reading
from evimo.cli.stopping import Stopped, asked_to_stop
from evimo.cli.view_capture import capture_subject, is_capture
from evimo.errors import BadInput, NotFound

if TYPE_CHECKING:
    from evimo.events.slices import Slice
    from evimo.formats.event_file import EventFile
    from evimo.recordings.recording import Recording
    from evimo.streaming.span import Span
    from evimo.viewing.window.subject import Subject

RERUN = ".rrd"
FIX = "another --save FILE, or more room on the disk"
NO_ROOM = "--save FILE.rrd on a disk with more room"


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """What the user wants to see.

    recording: of the run, if `path` is one. start_s, stop_s: after its beginning. speed: 1 is real time.
    """

    path: Path
    recording: Path | None
    reading: Reading
    start_s: float
    stop_s: float | None
    speed: float


def save_window(part: Part, file: Path) -> int:
    """Write a Rerun file, and return the exit code."""
    if part.path.suffix.lower() == RERUN:
        raise BadInput(f"{part.path} is a Rerun file already", fix=f"evimo view {part.path}, or copy it")
    code = _write(part, file, fix=FIX)
    print(f"  {file}")
    return code


def show(part: Part, *, in_browser: bool) -> int:
    """Show it until the user has seen enough, and return the exit code."""
    from evimo.viewing.window.viewers import check_display

    if not in_browser:
        check_display()
    if part.path.suffix.lower() == RERUN:
        if not part.path.is_file():
            raise NotFound(f"no file {part.path}", fix="a recording, the folder of a run, or a .rrd file")
        return _opened(part.path, in_browser=in_browser)
    with tempfile.TemporaryDirectory(prefix="evimo-view-") as folder:
        file = Path(folder) / f"{part.path.resolve().stem or 'recording'}{RERUN}"
        _write(part, file, fix=NO_ROOM)
        return _opened(file, in_browser=in_browser)


def _opened(file: Path, *, in_browser: bool) -> int:
    from evimo.viewing.window.viewers import has_display, page, window

    if not in_browser:
        with window(file) as viewer:
            return _until_closed(viewer)
    with page(file) as (server, address):
        print(f"{address}\nCtrl-C ends it", flush=True)
        if has_display():
            webbrowser.open(address)
        return _until_closed(server)


def _until_closed(process: subprocess.Popen[bytes]) -> int:
    """Wait for the user: the window closed, or Ctrl-C, which is the usual end of a server."""
    try:
        code = process.wait()
    except KeyboardInterrupt:
        return 0
    if code > 0:
        raise BadInput(f"Rerun's viewer ended with code {code}", fix="--web for a browser, or --save FILE.rrd")
    return 0


def _write(part: Part, file: Path, *, fix: str) -> int:
    """Write what there is to show, as far as the user lets it come; the exit code."""
    from evimo.events.slices import SLICE_US
    from evimo.viewing.window.filling import fill
    from evimo.viewing.window.store import new_store

    subject, span = _prepared(part)
    done, shown_us = 0, (span.first * SLICE_US, span.last * SLICE_US)
    with new_store(file, name=subject.name, fix=fix) as store:
        slices = _slices(subject, span)
        with (
            asked_to_stop("slice") as request,
            progress(len(span)) as advance,
            closing(slices),
        ):
            for _ in fill(store, subject, slices, shown_us=shown_us, speed=part.speed):
                done += 1
                advance()
                if request:
                    break
    early = done < len(span)
    words = f"{'stopped early: ' if early else ''}{done} slices, {done * SLICE_US * 1e-6:g} s of recording"
    print(words)
    return Stopped(request.number).code if early and request else 0


def _prepared(part: Part) -> "tuple[Subject, Span]":
    """What there is to show, opened, and which slices; everything checked that can be before it starts."""
    from evimo.viewing.window.sources import StoredTruth
    from evimo.viewing.window.subject import Subject, is_result, of_result, open_result

    if is_result(part.path):
        result = open_result(part.path)
        path = part.recording or result.recording
        events, recording = (None, None) if path is None else _opened_recording(path, part.reading)
        subject = of_result(result, events, recording)
        return subject, _span(subject, part)
    if part.recording is not None:
        raise BadInput(f"{part.path} is no folder of a run", fix="--recording only with the folder of a run")
    if is_capture(part.path):
        subject = capture_subject(part.path)
        return subject, _span(subject, part)
    events, recording = _opened_recording(part.path, part.reading)
    whole = part.path.resolve()
    subject = Subject(
        name=(whole.name if whole.is_dir() else whole.stem) or "recording",
        sensor=events.sensor,
        camera=None if recording is None else recording.camera,
        events=events,
        truth=None if recording is None else StoredTruth(recording),
    )
    return subject, _span(subject, part)


def _opened_recording(path: Path, reading: Reading) -> "tuple[EventFile, Recording | None]":
    from evimo.recordings.layouts import knows_truth
    from evimo.recordings.recording import open_recording

    if not knows_truth(path):
        return reading.opened(path), None
    recording = open_recording(path)
    return lasting(recording), recording


def lasting(recording: "Recording") -> "EventFile":
    """The events, said to last as long as truth is known: a resting camera may see none at the ends."""
    from evimo.events.slices import SLICE_US

    events, times_us = recording.events, recording.times_us
    first_us, last_us = (int(times_us[at]) // SLICE_US * SLICE_US for at in (0, -1))
    return replace(events, start_us=min(events.start_us, first_us), stop_us=max(events.stop_us, last_us + SLICE_US))


def _span(subject: "Subject", part: Part) -> "Span":
    """The slices to show: those of the recording, or without it those of the run."""
    from evimo.events.slices import SLICE_US
    from evimo.streaming.span import span_between, span_of

    if subject.events is not None:
        return span_of(subject.events, start_s=part.start_s, stop_s=part.stop_s)
    assert subject.estimates is not None  # a run
    times_us = subject.estimates.times_us
    first_us, last_us = (int(times_us[at]) // SLICE_US * SLICE_US for at in (0, -1))
    return span_between(first_us, last_us + SLICE_US, start_s=part.start_s, stop_s=part.stop_s)


def _slices(subject: "Subject", span: "Span") -> "Generator[Slice]":
    """The slices with their events, or empty ones where the recording is missing."""
    from evimo.events.events import no_events
    from evimo.events.slices import SLICE_US, Slice, in_slices

    if subject.events is None:
        yield from (Slice(k, k * SLICE_US, (k + 1) * SLICE_US, no_events()) for k in range(span.first, span.last))
        return
    start_us, stop_us = span.first * SLICE_US, span.last * SLICE_US
    yield from in_slices(subject.events.packets(start_us, stop_us), start_us=start_us, stop_us=stop_us)
