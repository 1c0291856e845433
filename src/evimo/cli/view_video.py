"""The video of `evimo view`: a recording, and what really happened in it where that is known."""

import math
import sys
import warnings
from collections.abc import Callable, Generator
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from evimo.cli.progress import progress
from evimo.cli.simulate import SIMULATING
from evimo.cli.stopping import Stopped, asked_to_stop
from evimo.cli.view_capture import is_capture
from evimo.cli.view_window import Part, lasting
from evimo.errors import BadInput, EvimoWarning, MissingExtra, NotFound, check_installed

if TYPE_CHECKING:
    from evimo.events.slices import Slice
    from evimo.formats.event_file import EventFile
    from evimo.recordings.recording import Recording
    from evimo.simulate.pictures import Light
    from evimo.streaming.span import Span
    from evimo.viewing.colours import Image

Drawer = Callable[["Slice"], "Image | None"]
"""From a slice to its frame; None where nothing is known of it."""

VIDEOS = (".mp4", ".mkv")
FASTEST_FPS = 60.0  # players drop images beyond their screen's rate: rather leave out slices


def save_video(part: Part, file: Path, *, picture: bool) -> int:
    """Write a video, and return the exit code.

    Raises:
        BadInput: there is nothing to show, or it cannot be written.
    """
    from evimo.events.slices import SLICE_US
    from evimo.viewing.video import whole_video

    _refuse_others(part)
    fps = part.speed * 1e6 / SLICE_US
    every = max(1, math.ceil(fps / FASTEST_FPS))
    with whole_video(file, fps=fps / every) as video:
        events, span, draw = _prepared(part, picture=picture)
        count, done = 0, 0
        with (
            asked_to_stop("frame") as request,
            progress(len(span)) as advance,
            closing(_slices(events, span)) as slices,
        ):
            for each in slices:
                image = draw(each) if (each.index - span.first) % every == 0 else None
                if image is not None:
                    video.write(image)
                    count += 1
                done += 1
                advance()
                if request:
                    break
        if request and not count:
            raise Stopped(request.number)
        if not count:
            raise BadInput(f"nothing is known of {part.path} in this span", fix="another --start or --stop")
    early = done < len(span)
    print(f"{'stopped early: ' if early else ''}{count} frames, {done * SLICE_US * 1e-6:g} s of recording\n  {file}")
    return Stopped(request.number).code if early else 0


def _refuse_others(part: Part) -> None:
    from evimo.viewing.window.subject import is_result

    if part.recording is not None or is_result(part.path):
        raise BadInput(
            f"{part.path} is of a run: its video was made with it", fix="its video.mp4, or --save FILE.rrd, or --web"
        )
    if is_capture(part.path):
        raise BadInput(
            f"{part.path} is a capture", fix="--save FILE.rrd, or a video of what `evimo annotate` makes of it"
        )
    if part.path.suffix.lower() == ".rrd":
        raise BadInput(f"{part.path} is a Rerun file, which no video is made of", fix="the recording that it shows")


def _prepared(part: Part, *, picture: bool) -> tuple["EventFile", "Span", Drawer]:
    """The events, the slices to show and how to draw one; everything checked that can be before it starts."""
    from evimo.recordings.layouts import knows_truth
    from evimo.recordings.recording import open_recording
    from evimo.streaming.span import span_of

    if knows_truth(part.path):
        recording = open_recording(part.path)
        span = span_of(lasting(recording), start_s=part.start_s, stop_s=part.stop_s)
        return recording.events, span, _truth_drawer(recording, _light(recording) if picture else None)
    from evimo.viewing.event_panel import EventPanel

    events = part.reading.opened(part.path)
    span, panel = span_of(events, start_s=part.start_s, stop_s=part.stop_s), EventPanel(events.sensor)
    return events, span, lambda each: panel.draw(each, time_origin_us=events.start_us)


def _light(recording: "Recording") -> "Light | None":
    if "seed" not in recording.meta:  # no film of the simulator
        return None
    try:
        check_installed("rendering what the camera saw", *SIMULATING, extra="simulate")
    except MissingExtra as error:
        warnings.warn(f"{error.problem}, and is left out: {error.fix}", EvimoWarning, stacklevel=2)
        return None
    from evimo.simulate.pictures import pictures

    print(
        f"rendering what the camera saw from seed {recording.meta.get('seed')}; --no-picture is faster", file=sys.stderr
    )
    light, text = None, f"{recording.path.name} was made by another version of evimo"
    try:
        light = pictures(recording)
    except NotFound as error:
        text = error.problem
    if light is None:
        text = f"{text}: its pictures cannot be rendered again"
        warnings.warn(text, EvimoWarning, stacklevel=2)
    return light


def _truth_drawer(recording: "Recording", light: "Light | None") -> Drawer:
    from evimo.viewing.truth_panels import TruthPanels, depth_bounds

    origin_us = lasting(recording).start_us
    some = sorted({0, len(recording) // 2, len(recording) - 1})
    bounds = depth_bounds(recording.truth(k) for k in some)
    panels = TruthPanels(recording.camera, bounds=bounds, intensity=light is not None)

    def draw(part: "Slice") -> "Image | None":
        truth = recording.truth_at(part.centre_us)
        if truth is None:
            return None
        seen = None if light is None else light(truth.t_us)
        return panels.draw(part, truth, time_origin_us=origin_us, light=seen)

    return draw


def _slices(events: "EventFile", span: "Span") -> Generator["Slice"]:
    from evimo.events.slices import SLICE_US, in_slices

    start_us, stop_us = span.first * SLICE_US, span.last * SLICE_US
    yield from in_slices(events.packets(start_us, stop_us), start_us=start_us, stop_us=stop_us)
