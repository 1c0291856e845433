"""`evimo run`: the main job, from recordings to videos, tables and maps."""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from evimo.cli.asked import Asked, heard_warnings
from evimo.cli.progress import progress
from evimo.cli.reading import AS_TOLD, Reading
from evimo.cli.stopping import Request, Stopped, asked_to_stop
from evimo.errors import BadInput
from evimo.jobs.crew import ALONE, Crew

if TYPE_CHECKING:
    from evimo.streaming.saving import Control, Saved


def run(
    recording: Path,
    *more: Path,
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
    crew: Annotated[Crew, Parameter(name="*")] = ALONE,
) -> int:
    """Find moving objects, depth and motion in a recording, or in each of several.

    Writes video.mp4, egomotion.csv, objects.csv, summary.json, and estimates.h5: the maps of every slice in sensor
    pixels. What is known up to scale only is called rel_…: its lengths are in mean depths of the scene. Ctrl-C stops
    early and leaves complete files of what was done.

    Args:
        recording: an event file of any known format; `evimo info` says what is inside.
        more: recordings. Each of several has a folder in that of --out, and the same command again runs over those
            that are not finished.
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
        crew: who runs over the recordings.
    """
    if not 0 < video_speed <= 100:
        raise BadInput(f"a video {video_speed:g} times as fast", fix="--video-speed between 0 and 100, as in 0.25")
    if camera and not calibration:
        raise BadInput(f"--camera {camera} names a camera of a calibration file", fix="--calibration FILE")
    crew.check()
    from evimo.formats.recognition import check_there

    check_there((recording, *more))
    asked = Asked(
        model=model,
        calibration=(calibration, camera),
        reading=reading,
        start_s=start,
        stop_s=stop,
        dense=dense,
        event_labels=event_labels,
        imu=imu,
        video_speed=video_speed if video else None,
    )
    if more or not crew.is_alone:
        return _run_all(asked, (recording, *more), out, crew)
    return _run_alone(asked, recording, out or _default_folder(recording))


def _run_all(asked: Asked, recordings: tuple[Path, ...], out: Path | None, crew: Crew) -> int:
    from evimo.cli.several import folders_of, run_several

    if len(recordings) == 1:
        shared = out or _default_folder(recordings[0])
        folders = {recordings[0]: shared}
    else:
        shared = out or Path("out")
        folders = folders_of(recordings, shared)
    count = run_several(asked, folders, crew=crew, shared=shared)
    print(f"{len(folders)} recordings in {shared}, {count} of them run over now")
    return 0


def _run_alone(asked: Asked, recording: Path, out: Path) -> int:
    """The run over one recording by this process, which tells of every slice and can be stopped after any."""
    from evimo.streaming.beside import compiled_beside

    with heard_warnings() as heard, compiled_beside():
        prepared = asked.prepared(recording)
        from evimo.streaming.saving import save_run

        wanted = asked.wanted(prepared)
        with _controlled(len(prepared.span), heard) as (control, request):
            saved = save_run(prepared, out, wanted, settings=asked.settings, control=control)
    if saved is None:
        raise Stopped(request.number)
    print(_told(saved))
    return Stopped(request.number).code if saved.summary["interrupted"] else 0


def _default_folder(recording: Path) -> Path:
    return Path("out") / (recording.resolve().stem or "recording")


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
