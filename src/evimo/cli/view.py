"""`evimo view`: a recording, a run or a capture in a window, in a browser, as a Rerun file or as a video."""

from pathlib import Path

from evimo.cli.reading import AS_TOLD, Reading
from evimo.cli.view_video import VIDEOS, save_video
from evimo.cli.view_window import RERUN, Part, save_window, show
from evimo.errors import BadInput


def view(
    path: Path,
    *,
    save: Path | None = None,
    web: bool = False,
    recording: Path | None = None,
    speed: float = 0.25,
    start: float = 0.0,
    stop: float | None = None,
    reading: Reading = AS_TOLD,
    picture: bool = True,
) -> int:
    """Look at a recording, or at what a run found in it beside what really happened.

    Opens a window (Rerun's, with the extra [view]) that can be scrubbed in time: the world with the camera, its cone
    of vision, objects and their ways; events, masks and depth; speeds as curves. Truth is shown where it is known, as
    in what `evimo simulate` makes, or follows from the poses and scans of a capture; estimates where PATH is the folder
    of a run. Ctrl-C leaves or shows what was
    done.

    Args:
        path: a recording of any known format, the folder of a run (with its estimates.h5), the folder of a
            capture (docs/captures.md), or a .rrd file.
        save: open nothing, and write FILE: .rrd for Rerun, .mp4 or .mkv for a video, which needs no extra. A file of
            that name is replaced once the new one is complete.
        web: show it in a browser, from this machine and without the network, until Ctrl-C.
        recording: that of the run, where it is not where it was.
        speed: of playing, 1 being real time; the default is slow enough to watch single slices.
        start: seconds after the recording's beginning. Slices lie on its own clock and do not move with it.
        stop: seconds after the recording's beginning.
        reading: what the recording does not tell.
        picture: render what the camera saw, in a video of a simulated recording; it takes most of the time.
    """
    if not 0 < speed <= 100:
        raise BadInput(f"to play {speed:g} times as fast", fix="--speed between 0 and 100, as in 0.25")
    part = Part(path=path, recording=recording, reading=reading, start_s=start, stop_s=stop, speed=speed)
    if save is None:
        return show(part, in_browser=web)
    if web:
        raise BadInput("--web and --save at once", fix="--save FILE.rrd, then: evimo view FILE.rrd --web")
    suffix = save.suffix.lower()
    if suffix == RERUN:
        return save_window(part, save)
    if suffix not in VIDEOS:
        raise BadInput(f"{save.name} is no name of a Rerun file or of a video", fix="end it with .rrd, .mp4 or .mkv")
    return save_video(part, save, picture=picture)
