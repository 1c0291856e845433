"""`evimo view`: a recording as a video, and what really happened in it where that is known."""

import math
import sys
import warnings
from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from evimo.cli.progress import progress
from evimo.cli.reading import AS_TOLD, Reading
from evimo.cli.simulate import SIMULATING
from evimo.cli.stopping import Stopped, asked_to_stop
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

FASTEST_FPS = 60.0  # players drop images beyond their screen's rate: rather leave out slices


def view(
    recording: Path,
    *,
    out: Path | None = None,
    speed: float = 0.25,
    start: float = 0.0,
    stop: float | None = None,
    reading: Reading = AS_TOLD,
    picture: bool = True,
) -> int:
    """Show a recording as a video.

    Of a recording made by `evimo simulate` it shows what really happened: events, objects by their ids, depth in m,
    dense flow, the camera's motion, the objects' velocities, and the picture that the camera saw, rendered again from
    the recording's seed. Of any other recording it shows the events. Ctrl-C leaves a complete video of what was done.

    Args:
        recording: a folder or .npz file made by `evimo simulate`, or an event file of any known format.
        out: the video, .mp4 or .mkv; out/NAME.mp4 by default. A file of that name is replaced once the new one is
            complete.
        speed: of the video, 1 being real time; the default is slow enough to watch single slices.
        start: seconds after the recording's beginning. Slices lie on its own clock and do not move with it.
        stop: seconds after the recording's beginning.
        reading: what the recording does not tell.
        picture: render what the camera saw; it takes most of the time.
    """
    if not 0 < speed <= 100:
        raise BadInput(f"a video {speed:g} times as fast", fix="--speed between 0 and 100, as in 0.25")
    from evimo.events.slices import SLICE_US
    from evimo.viewing.video import whole_video

    out, fps = out or _default_file(recording), speed * 1e6 / SLICE_US
    every = max(1, math.ceil(fps / FASTEST_FPS))
    with whole_video(out, fps=fps / every) as video:
        events, span, draw = _prepared(recording, reading, span_s=(start, stop), picture=picture)
        count, done = 0, 0
        with (
            asked_to_stop("frame") as request,
            progress(len(span)) as advance,
            closing(_slices(events, span)) as slices,
        ):
            for part in slices:
                image = draw(part) if (part.index - span.first) % every == 0 else None
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
            raise BadInput(f"nothing is known of {recording} in this span", fix="another --start or --stop")
    early = done < len(span)
    print(f"{'stopped early: ' if early else ''}{count} frames, {done * SLICE_US * 1e-6:g} s of recording\n  {out}")
    return Stopped(request.number).code if early else 0


def _default_file(recording: Path) -> Path:
    whole = recording.resolve()
    return Path("out") / f"{(whole.name if whole.is_dir() else whole.stem) or 'recording'}.mp4"


def _prepared(
    path: Path, reading: Reading, *, span_s: tuple[float, float | None], picture: bool
) -> tuple["EventFile", "Span", Drawer]:
    """The events, the slices to show and how to draw one; everything checked that can be before it starts."""
    from evimo.recordings.layouts import knows_truth
    from evimo.recordings.recording import open_recording
    from evimo.streaming.span import span_of

    if knows_truth(path):
        recording = open_recording(path)
        span = span_of(_lasting(recording), start_s=span_s[0], stop_s=span_s[1])
        return recording.events, span, _truth_drawer(recording, _light(recording) if picture else None)
    from evimo.viewing.event_panel import EventPanel

    events = reading.opened(path)
    span, panel = span_of(events, start_s=span_s[0], stop_s=span_s[1]), EventPanel(events.sensor)
    return events, span, lambda part: panel.draw(part, time_origin_us=events.start_us)


def _lasting(recording: "Recording") -> "EventFile":
    """The events, said to last as long as truth is known: a resting camera may see none at the ends."""
    from evimo.events.slices import SLICE_US

    events, times_us = recording.events, recording.times_us
    first_us, last_us = (int(times_us[at]) // SLICE_US * SLICE_US for at in (0, -1))
    return replace(events, start_us=min(events.start_us, first_us), stop_us=max(events.stop_us, last_us + SLICE_US))


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

    origin_us = _lasting(recording).start_us
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
