"""`evimo run`: the main job, from a recording to a video, tables and maps."""

import warnings
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from evimo.cli.progress import progress
from evimo.cli.reading import AS_TOLD, Reading
from evimo.cli.stopping import Request, Stopped, asked_to_stop
from evimo.errors import BadInput, EvimoWarning

if TYPE_CHECKING:
    from evimo.streaming.pipeline import Run
    from evimo.streaming.saving import Control, Saved

SHORT_S = 60.0  # of recording: below it the maps are written unless told otherwise


def run(
    recording: Path,
    *,
    model: str = "small",
    calibration: Path | None = None,
    camera: str | None = None,
    reading: Reading = AS_TOLD,
    out: Path | None = None,
    start: float = 0.0,
    stop: float | None = None,
    dense: bool | None = None,
    event_labels: bool = False,
    imu: Literal["auto", "off"] = "auto",
    video: bool = True,
    video_speed: float = 0.25,
) -> int:
    """Find moving objects, depth and motion in a recording.

    Writes video.mp4, egomotion.csv, objects.csv, summary.json, and estimates.h5: the maps of every slice in sensor
    pixels. What is known up to scale only is called rel_…: its lengths are in mean depths of the scene. Ctrl-C stops
    early and leaves complete files of what was done.

    Args:
        recording: an event file of any known format; `evimo info` says what is inside.
        model: a preset's name, or an .onnx file, or classical, a method that needs no weights. ecn, the paper's rival,
            estimates depth and the camera's motion, and no moving objects: their files and maps are left out.
        calibration: of the camera: a file by kalibr, ROS, OpenCV, Metavision or DV, among others. Without it what the
            recording says of itself, else a guess.
        camera: its name in the calibration file, where that holds several that fit.
        reading: what the recording does not tell.
        out: folder of the results; out/NAME by default. Files of the same name are replaced once the new ones are
            complete.
        start: seconds after the first event. Slices lie on the recording's own clock and do not move with it.
        stop: seconds after the first event.
        dense: write estimates.h5; by default for less than 60 s of recording.
        event_labels: write events.h5, every event with the object that it belongs to. The events then also sharpen the
            objects' velocities, in objects.csv too.
        imu: auto takes the camera's rotation from the recording's gyroscope, where there is one whose axes are known or
            can be found; off takes it from the events alone. summary.json says which it was.
        video: make video.mp4.
        video_speed: of the video, 1 being real time; the default is slow enough to watch single slices.
    """
    if not 0 < video_speed <= 100:
        raise BadInput(f"a video {video_speed:g} times as fast", fix="--video-speed between 0 and 100, as in 0.25")
    if camera and not calibration:
        raise BadInput(f"--camera {camera} names a camera of a calibration file", fix="--calibration FILE")
    with _heard_warnings() as heard:
        how = {"start_s": start, "stop_s": stop, "event_labels": event_labels, "imu": imu}
        prepared = _prepared(recording, reading, model=model, calibration=(calibration, camera), how=how)
        from evimo.streaming.saving import Wanted, save_run

        dense = prepared.span.length_s < SHORT_S if dense is None else dense
        wanted = Wanted(dense=dense, video_speed=video_speed if video else None)
        settings = how | {"calibration": calibration and calibration.name, "camera": camera} | reading.settings
        with _controlled(len(prepared.span), heard) as (control, request):
            saved = save_run(prepared, out or _default_folder(recording), wanted, settings=settings, control=control)
    if saved is None:
        raise Stopped(request.number)
    print(_told(saved))
    return Stopped(request.number).code if saved.summary["interrupted"] else 0


def _default_folder(recording: Path) -> Path:
    return Path("out") / (recording.resolve().stem or "recording")


def _prepared(
    recording: Path, reading: Reading, *, model: str, calibration: tuple[Path | None, str | None], how: dict[str, Any]
) -> "Run":
    """The run over a recording, everything checked that can be before it starts.

    `calibration` is a file and the camera's name in it; `how` as in `Run`.
    """
    from evimo.streaming.models import model_of
    from evimo.streaming.pipeline import Run

    network = model_of(model)
    events = reading.opened(recording)
    file, name = calibration
    camera = None
    if file:
        from evimo.geometry.calibration import load_camera

        camera = load_camera(file, size=events.sensor, topic=events.topic, camera=name)
    return Run(events, network, camera=camera, **how)


@contextmanager
def _heard_warnings() -> Generator[list[str]]:
    """Our warnings as a list for the summary, once each; they are shown as before."""
    heard: list[str] = []
    shown = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
        if issubclass(category, EvimoWarning) and str(message) not in heard:
            heard.append(str(message))
        shown(message, category, *where, **more)

    warnings.showwarning = show
    try:
        yield heard
    finally:
        warnings.showwarning = shown


@contextmanager
def _controlled(total: int, heard: list[str]) -> Generator[tuple["Control", Request]]:
    """Progress for each slice, and the request to stop early."""
    from evimo.streaming.saving import Control

    control = Control(warnings=heard)

    def stop() -> None:
        control.stopped = True

    with asked_to_stop("slice", stop) as request, progress(total) as advance:
        control.finished_slice = advance
        yield control, request


def _told(saved: "Saved") -> str:
    """The headline numbers and the files."""
    facts = saved.summary
    end = "stopped early; all files are complete up to there: " if facts["interrupted"] else ""
    objects, lasting = facts["objects_seen"], facts["objects_seen_for_100_ms"]
    found = f"{objects} moving object{'' if objects == 1 else 's'} seen, {lasting} for 0.1 s or longer"
    if objects is None:
        found = f"moving objects not estimated by {facts['model']['name']}"
    headline = f"{end}{facts['slices']} slices at {facts['slices_per_s']:.1f} slices/s, {found}"
    return "\n".join([headline, *(f"  {path}" for path in saved.files)])
